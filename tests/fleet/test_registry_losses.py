"""What is removed from a registry or its archive is noticed, and a batch writes again what the archive has."""

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from camssf import cli
from camssf.errors import InvalidArgument, UnreadableRaw
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.record_files import DAMAGED
from camssf_fleet.registry import Registry
from tests.fleet.conftest import Said
from tests.support.desk import Desk, stub, template
from tests.support.registries import holding, rewritten

pytestmark = pytest.mark.full  # each loss is compared with the archive

Loss: TypeAlias = Callable[[Path], object]
NAMES = [f"c{number}" for number in range(6)]
WRITTEN = "name, serial, captured, model, key, made_from, extra"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three batches of two cameras each, not compacted; a copy of the registry before the last."""
    home = tmp_path_factory.mktemp("made") / "home"
    home.mkdir()
    desk = Desk(home)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("camssf_fleet.record_files.RecordFiles.compact", lambda self, least=2: 0)
        for count in (2, 4, 6):
            if count == 6:
                shutil.copytree(home / "phones", home / "backup")
            rows = [f"{name},{name},D55,,,,S{name},lab" for name in NAMES[:count]]
            desk.write(rows, {name: f"Phone {name}" for name in NAMES[count - 2 : count]})
            desk.run()
    assert len(list((home / "phones").iterdir())) == 9, "of each batch, results, ends of jobs, and a list"
    shutil.copytree(home, home.parent / "copy")
    return home


@pytest.fixture
def home(made: Path) -> Path:
    """As it was, at the same place: a task knows its photos by their paths."""
    shutil.rmtree(made)
    shutil.copytree(made.parent / "copy", made)
    return made


@pytest.fixture
def verify(home: Path, said: Said) -> Callable[..., dict[str, Any]]:
    """What `camssf registry verify` prints."""
    return partial(said.document, "verify", home / "phones")


def remove(home: Path, condition: str) -> None:
    """Remove files of the registry by what they hold."""
    for file in holding(Registry(home / "phones"), condition):
        file.unlink()


def edited(change: Callable[[bytes], bytes], kind: str = "result") -> Loss:
    """Bytes of a file change; as `verify` advises, it is moved away afterwards (`MOVED`)."""

    def edit(home: Path) -> None:
        file, *_ = holding(Registry(home / "phones"), f"kind = '{kind}'")
        file.write_bytes(change(file.read_bytes()))

    return edit


def by_another_program(columns: str, where: str = "true") -> Loss:
    """Another program writes each file again, without some records or with others, and names it by its content."""

    def rewrite(home: Path) -> None:
        for file in sorted((home / "phones").glob("*.parquet")):
            if rewritten(file, columns, home / "phones", where) != file:
                file.unlink()

    return rewrite


def restored(home: Path) -> None:
    """An old backup takes the place of the registry."""
    shutil.rmtree(home / "phones")
    shutil.copytree(home / "backup", home / "phones")


LOSSES: dict[str, Loss] = {
    **{f"file {n}": lambda home, n=n: sorted((home / "phones").iterdir())[n].unlink() for n in range(9)},
    "row and job, by another program": by_another_program("*", "NOT (name = 'c1')"),
    "a changed record": by_another_program(
        "* REPLACE (if(serial = 'Sc2' AND kind = 'result', 'X', serial) AS serial)"),
    "a flipped bit": edited(lambda data: data[:300] + bytes([data[300] ^ 4]) + data[301:]),
    "a cut file": edited(lambda data: data[:-500]),
    "a damaged list": edited(lambda data: data[:-100] + bytes(100), "list"),
    "a strange file": lambda home: (home / "phones" / "notes.txt").write_text("dear"),
    "a result's folder": lambda home: shutil.rmtree(next(home.glob("out/*/*"))),
    "the archive": lambda home: shutil.rmtree(home / "out"), "an old backup of all": restored,
}  # fmt: skip
MOVED = ("a flipped bit", "a cut file", "a damaged list", "a strange file", "a changed record")
"""Losses after which a file is moved away, as the message says."""


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_is_noticed_and_a_batch_restores_it(home: Path, loss: str, verify: Any, said: Said) -> None:
    desk = Desk(home)
    before = desk.rows(WRITTEN)
    LOSSES[loss](home)
    found = verify(status=cli.PARTED)
    assert found["faults"]
    assert "damaged: " in said("verify", home / "phones", status=cli.PARTED)[1]
    if loss == "a cut file":  # of a damaged file all say the same
        with pytest.raises(InvalidArgument, match="damaged or missing") as raised:
            desk.run()
        assert raised.value.advice == DAMAGED
        assert all(words in DAMAGED and words in found["advice"] for words in ("away", "backup", "camssf batch"))
    if loss in MOVED:
        places = [fault.partition(" ")[0] for fault in found["faults"] if str(home / "phones") in fault]
        (named,) = {place.removesuffix(":") for place in places}
        Path(named).rename(home / "moved away")
    summary = desk.run()
    assert (summary.total, summary.failed) == (6, 0)
    assert desk.rows(WRITTEN) == before
    verify()
    again = desk.run()
    assert (again.resumed, again.added) == (6, 0)


@pytest.mark.requirement("R-REGISTRY")
def test_a_backup_is_laid_over_by_copying_what_lacks(home: Path, verify: Any) -> None:
    """After any loss, and after anything that was written since."""
    desk, phones, whole = Desk(home), home / "phones", home / "whole"
    before = desk.rows(WRITTEN)
    shutil.copytree(phones, whole)
    remove(home, "kind = 'list'")
    for file in sorted(phones.iterdir())[:2]:
        file.unlink()
    for file in whole.iterdir():
        if not (phones / file.name).exists():
            shutil.copy(file, phones)
    assert desk.rows(WRITTEN) == before
    verify()
    Registry(phones).files.compact()
    shutil.copytree(whole, phones, dirs_exist_ok=True)
    assert desk.rows(WRITTEN) == before, "each record twice, which counts once"
    verify()


@pytest.mark.requirement("R-REGISTRY")
def test_a_head_notices_an_old_copy_that_is_whole(home: Path, verify: Any) -> None:
    (head,) = verify()["heads"]
    for words in (head, head[:12]):
        verify("--head", words)
    restored(home)
    shutil.rmtree(home / "out")  # the archive knows, too
    faults = verify("--head", head, status=cli.PARTED)["faults"]
    assert any(f"the list {head[:12]} given as head is missing" in fault for fault in faults)


def test_a_deleted_unit_is_not_missed(home: Path, verify: Any) -> None:
    """Its document remains in the archive."""
    assert cli.main(["registry", "delete", str(home / "phones"), "Sc2"]) == 0
    verify()
    assert Desk(home).run().added == 1, "as the manifest has it still"
    assert len(Desk(home).rows()) == 6
    verify()


def unreadable(job: Job, folder: Path) -> Outcome:
    """As the calibration does it: a photo that cannot be read gives a refusal with a document."""
    if Path(job.photos[0]).exists() and Path(job.photos[0]).read_text() != "torn":
        return stub(job, folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(json.dumps(template(True)), "utf-8")
    return Outcome(job.name, "refused", UnreadableRaw.code, f"{job.photos[0]} cannot be read.")


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize(("lost", "resumed"), [("serial = 'Sc2' AND kind = 'result'", 4), ("kind = 'result'", 0)])
@pytest.mark.parametrize("torn", [False, True])
def test_a_lost_row_comes_back_without_photo(home: Path, verify: Any, lost: str, resumed: int, torn: bool) -> None:
    """The photo is said, and no refusal takes the place of a result with curves."""
    desk, photo = Desk(home), home / "c2"
    before = desk.rows(WRITTEN)
    remove(home, lost)
    photo.write_text("torn") if torn else photo.unlink()
    for again in (resumed, 6):
        found = desk.run(work=unreadable)
        assert (found.total, found.failed, found.resumed) == (6, 1, again)
        said = found.examples[UnreadableRaw.code]
        assert said == f"c2: {photo} cannot be read. The earlier result of this name was kept as it is."
        assert desk.rows(WRITTEN) == before
        verify()
    photo.write_text("Phone c2")
    assert desk.run(work=unreadable).failed == 0
