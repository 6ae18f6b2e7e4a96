"""The registry: every acknowledged row once, whoever writes, dies, gathers or reads."""

from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Any
from unittest.mock import DEFAULT, Mock

import numpy as np
import pytest

from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from camssf.files import ASIDE
from camssf.photo.read.unit import Unit
from camssf_fleet import record_files
from camssf_fleet.record_files import RecordFiles
from camssf_fleet.records import Origin, row
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify
from tests.support.documents import document
from tests.support.failures import raising
from tests.support.processes import until
from tests.support.registries import START, bells, correct, ended, holding, keys, made, meanwhile, rewritten, writing

pytestmark = pytest.mark.full  # processes that are killed, disks that are full: half a minute


@pytest.mark.requirement("R-REGISTRY")
def test_a_writer_that_was_killed_leaves_it_readable(one: Registry) -> None:
    """A file that is half written is hidden; records without a list are named until the next writer lists them."""
    one.add([made(1)])
    (one.folder / f"{ASIDE}80").mkdir()
    (one.folder / f"{ASIDE}80" / "half").write_bytes(b"PAR1")
    one.append([made(2)], [ended("c")])
    assert len(keys(Registry(one.folder))) == 2
    (fault,) = verify(one).faults
    assert fault.startswith("2 records in no list: their writer was stopped or still writes, or the list is lost (")
    one.add([made(3)])
    assert verify(one).faults == ()
    one.files.compact()
    assert (len(keys(Registry(one.folder))), verify(one).faults) == (3, ())


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("last", [0, 1, 2, 5, 8, 9, 11])  # 1 and 9: both files are written, none is taken away
def test_a_compaction_may_be_killed_anywhere(one: Registry, last: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the step number `last`: a file written or taken away."""
    for number in range(4):
        one.append([made(number, serial=str(number))], [ended(str(number))])
        one.list_records()
    before, steps = one.query("SELECT * FROM rows ORDER BY key"), iter(range(last))
    for name in ("_write", "_remove"):
        real = getattr(RecordFiles, name)

        def step(self: RecordFiles, *values: Any, real: Any = real) -> Any:
            if next(steps, None) is None:
                raise KeyboardInterrupt
            return real(self, *values)

        monkeypatch.setattr(RecordFiles, name, step)
    with suppress(KeyboardInterrupt):
        one.files.compact()
    monkeypatch.undo()
    for _ in range(2):
        assert (one.query("SELECT * FROM rows ORDER BY key"), verify(one).faults) == (before, ())
        assert len(one.query("SELECT DISTINCT task FROM jobs")) == 4
        one.files.compact()


@pytest.mark.requirement("R-REGISTRY")
def test_a_compaction_leaves_damaged_and_strange_files_alone(one: Registry, tmp_path: Path) -> None:
    """It would give them a right name, and take the evidence away."""
    for number in range(4):
        one.add([made(number, serial=f"S{number}")])
    (file,) = holding(one, "kind = 'result' AND serial = 'S2'")
    whole = file.read_bytes()
    changed = rewritten(file, "* REPLACE ('WRONG' AS serial)", tmp_path).read_bytes()
    file.write_bytes(changed)
    one.files.compact()
    assert file.read_bytes() == changed
    assert any(f"{file} differs from its name" in fault for fault in verify(one).faults)
    with pytest.raises(InvalidArgument, match="differs from its name"):
        one.delete(Unit(serial="WRONG"))
    file.write_bytes(whole)
    assert one.query("SELECT serial FROM rows WHERE key LIKE '%2'") == [{"serial": "S2"}]
    assert not [fault for fault in verify(one).faults if "still in a file" not in fault and "is missing" not in fault]


@pytest.mark.parametrize("columns", ["'x' AS foo", "* REPLACE ('x' AS revision)"])
def test_a_file_of_another_program_with_a_right_name_is_named(one: Registry, columns: str) -> None:
    one.add([made(1)])
    strange = rewritten(holding(one, "kind = 'result'")[0], columns, Path(one.folder))
    (fault,) = verify(one).faults
    assert fault.startswith(f"{strange} is no file of a registry (its columns ")


@pytest.mark.requirement("R-REGISTRY")
def test_every_flipped_bit_is_found(one: Registry, tmp_path: Path) -> None:
    """In results, jobs, lists and documents."""
    for number in range(3):
        data = document_bytes(document()) + b" " * number
        (tmp_path / f"{number}.json").write_bytes(data)
        one.add([row(data, document(), Origin(place=f"../{number}.json"))])
        one.add([made(n, bells(), model=f"M{n % 3}") for n in range(5 * number, 5 * number + 5)])
    one.append([], [ended("x")])
    one.list_records()
    found = verify(one)
    assert (found.rows, found.documents, found.documents_missing, found.faults) == (18, 3, 0, ())
    files = [path for path in (*one.folder.rglob("*"), *tmp_path.glob("*.json")) if path.is_file()]
    dice = np.random.default_rng(0)
    for number in range(2 * len(files)):
        path = files[number % len(files)]
        whole = path.read_bytes()
        at, bit = int(dice.integers(len(whole))), int(dice.integers(8))
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
        assert any(str(path) in fault for fault in verify(Registry(one.folder)).faults), (path.name, at, bit)
        path.write_bytes(whole)
    assert not verify(one).faults


@pytest.mark.requirement("R-REGISTRY")
def test_writers_that_contradict_each_other_at_once(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither saw the other: both records stay, `verify` names the contradiction, and a correction settles it."""
    one.add([made(1, serial=""), made(4)])

    def add() -> None:
        Registry(one.folder).add([made(1, serial="theirs"), made(2), made(3, serial="theirs")])
        one.files.compact()

    meanwhile(monkeypatch, "Registry._held", add)
    one.add([made(1, serial="mine"), made(2), made(3, serial="mine")])
    assert len(keys(one)) == 4
    (fault,) = verify(one).faults  # the same words of both
    assert f"two writers gave the result {0:012x} two values of serial: mine and theirs" in fault
    assert verify(one).advice == "Add the result again with what is right, and --correct."
    for number in (1, 3):
        (shown,) = one.query("SELECT serial FROM rows WHERE key = ?", [f"{number:064x}"])
        (said,) = correct(one, made(number, serial=shown["serial"]))
        assert said.changes == (f"serial settled as {shown['serial']}",)
    assert verify(one).faults == ()
    correct(one, made(1, serial="mine"), made(3, serial="mine"))
    serials = one.query("SELECT DISTINCT serial FROM rows WHERE key LIKE '%1' OR key LIKE '%3'")
    assert (serials, verify(one).faults) == ([{"serial": "mine"}], ())


def test_two_writers_that_begin_a_registry_together(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other one writes its first file between this one's two looks into the folder."""
    meanwhile(monkeypatch, "RecordFiles.sizes", lambda: Registry(one.folder, new=True).add([made(1)]))
    Registry(one.folder, new=True).add([made(2)])
    assert len(keys(one)) == 2


@pytest.mark.requirement("R-REGISTRY")
def test_a_fact_of_a_result_that_was_just_deleted_is_named(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    one.add([made(1, serial="A"), made(2, serial="B")])
    meanwhile(monkeypatch, "Registry._held", lambda: Registry(one.folder).delete(Unit(serial="A")))
    one.add([made(1, serial="A", lens="50mm")])
    assert len(keys(one)) == 1
    assert verify(one).faults == (f"facts are said of the result {0:012x}, which is not there",)
    one.add([made(1, serial="A", lens="50mm")])
    assert (len(keys(one)), verify(one).faults) == (2, ())


def test_a_file_that_vanishes_while_it_is_read(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when somebody deletes a unit between the look into the folder and the reading."""
    one.add([made(number, serial=str(number)) for number in range(4)])
    meanwhile(monkeypatch, "RecordFiles.sizes", lambda: Registry(one.folder).delete(Unit(serial="3")))
    assert len(keys(one)) == 3


@pytest.mark.requirement("R-REGISTRY")
def test_a_clock_that_is_set_back_moves_nothing(one: Registry) -> None:
    """What corrects counts, whatever the clock says."""
    one.add([made(1, serial="A", added=START + timedelta(days=900))])
    for days, serial in ((0, "B"), (-500, "C"), (3000, "D"), (-900, "A"), (-901, "B")):
        correct(one, made(1, serial=serial, added=START + timedelta(days=days)))
        assert one.query("SELECT serial FROM rows") == [{"serial": serial}]
    assert len(one.history(Unit(serial="A"))) == 6
    assert verify(one).faults == ()


@pytest.mark.parametrize(("write", "words"), [(1, "No space"), (2, "The results were added, but then: .*No space")])
def test_a_full_disk_leaves_all_or_nothing(one: Registry, write: int, words: str, monkeypatch: Any) -> None:
    """The second file is the list."""
    one.add([made(1)])
    ends = [DEFAULT] * (write - 1) + [OSError(28, "No space left on device")]
    monkeypatch.setattr(record_files, "write_place", Mock(wraps=record_files.write_place, side_effect=ends))
    with pytest.raises(InvalidArgument, match=words) as caught:
        one.add([made(2)])
    monkeypatch.undo()
    assert caught.value.message.startswith("The results were added") == (write == 2)
    assert len(keys(one)) == write
    one.add([made(2)])
    assert (len(keys(one)), verify(one).faults) == (2, ())


@pytest.mark.requirement("R-REGISTRY")
def test_a_killed_deletion_is_finished_by_the_same_command(one: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    one.add([made(1, serial="A"), made(2, serial="B")])
    monkeypatch.setattr(RecordFiles, "drop", raising(KeyboardInterrupt()))
    with pytest.raises(KeyboardInterrupt):
        one.delete(Unit(serial="A"))
    monkeypatch.undo()
    assert (len(keys(one)), verify(one).faults) == (1, ("1 deleted record still in a file",))
    one.delete(Unit(serial="A"))
    assert (len(keys(one)), verify(one).faults) == (1, ())


@pytest.mark.requirement("R-REGISTRY")
def test_six_writers_two_of_them_killed(one: Registry) -> None:
    """Somebody reads and somebody gathers meanwhile. All that was acknowledged is there, once."""
    rows = {number: 20 if number > 2 else 1_000_000 for number in range(1, 7)}  # victims never end by themselves
    added: list[list[str]] = []
    with writing(str(one.folder), rows) as writers:
        until(one.files.sizes, 240)
        reader = Registry(one.folder)
        for victim in writers[:2]:
            acknowledged_first = victim.stdout.readline().decode().strip()
            stored = keys(reader)
            assert acknowledged_first in stored
            assert len(stored) == len(set(stored))
            reader.files.compact()
            victim.kill()
            added.append([acknowledged_first])
        added += [process.communicate(timeout=240)[0].decode().splitlines() for process in writers]
    assert [process.returncode != 0 for process in writers] == [True] * 2 + [False] * 4
    stored, acknowledged = keys(reader), {line for lines in added for line in lines}
    assert len(stored) == len(set(stored))
    assert acknowledged <= set(stored)
    assert len(set(stored) - acknowledged) <= 10  # a task of each victim that was safe, and he did not live to say so
    reader.files.compact()
    assert keys(reader) == stored
    reader.list_records()
    assert verify(reader).faults == ()
