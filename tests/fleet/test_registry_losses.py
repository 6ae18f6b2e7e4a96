"""What is removed from a registry or its archive is noticed, and a batch writes again what the archive has."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from camssf import cli
from tests.fleet.test_stream import Desk, made_templates, stub

pytest.importorskip("duckdb", reason="duckdb is not here")

from camssf.errors import InvalidArgument, UnreadableRaw
from camssf_fleet.batch import WorkInFolder
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.record_files import DAMAGED
from camssf_fleet.registry import Registry

NAMES = [f"c{number}" for number in range(6)]
WRITTEN = "name, serial, captured, model, key, made_from, extra"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three batches of two cameras each, not compacted; a copy of the registry before the last."""
    home = tmp_path_factory.mktemp("made") / "home"
    home.mkdir()
    desk = Desk(home, made_templates())
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("camssf_fleet.record_files.RecordFiles.compact", lambda self, least=2: 0)
        for count in (2, 4, 6):
            if count == 6:
                shutil.copytree(home / "phones", home / "backup")
            rows = [f"{name},{name},D55,,,,S{name},lab" for name in NAMES[:count]]
            desk.write(rows, {name: f"Phone {name}" for name in NAMES[count - 2 : count]})
            desk.run()
    assert len(list((home / "phones").iterdir())) == 9, "of each batch, results, ends of jobs, and a list"
    return home


@pytest.fixture
def home(made: Path) -> Path:
    """As it was, at the same place: a task knows its photos by their paths."""
    copy = made.parent / "copy"
    if not copy.exists():
        shutil.copytree(made, copy)
    shutil.rmtree(made)
    shutil.copytree(copy, made)
    return made


def holder(where: str) -> Callable[[Path], None]:
    """A file of the registry is removed, by what it holds."""

    def remove(home: Path) -> None:
        sql = f"SELECT DISTINCT filename FROM stored WHERE {where}"
        for (file,) in Registry(home / "phones").files.ask(lambda con: con.execute(sql).fetchall()):
            Path(file).unlink()

    return remove


def gone(pattern: str, which: int = 0) -> Callable[[Path], None]:
    """A file or a folder is removed."""

    def remove(home: Path) -> None:
        path = sorted(home.glob(pattern))[which]
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return remove


def edited(change: Callable[[bytes], bytes], kind: str = "result") -> Callable[[Path], None]:
    """Bytes of a file change; as `verify` advises, it is moved away afterwards (`MOVED`)."""

    def edit(home: Path) -> None:
        sql = "SELECT filename FROM stored WHERE kind = ? ORDER BY filename"
        file, *_ = Registry(home / "phones").files.ask(lambda con: con.execute(sql, [kind]).fetchone())
        Path(file).write_bytes(change(Path(file).read_bytes()))

    return edit


def by_another_program(where: str) -> Callable[[Path], None]:
    """Another program writes a file again without some records, and names it by its content."""

    def rewrite(home: Path) -> None:
        import hashlib

        import duckdb

        for file in sorted((home / "phones").glob("*.parquet")):
            target = home / "rewritten"
            duckdb.sql(f"COPY (SELECT * FROM '{file}' WHERE NOT ({where})) TO '{target}' (FORMAT parquet)")
            file.unlink()
            target.rename(file.with_name(f"{hashlib.sha256(target.read_bytes()).hexdigest()}.parquet"))

    return rewrite


def changed_by_another_program(home: Path) -> None:
    """As above, with another serial number in a record."""
    import hashlib

    import duckdb

    for file in sorted((home / "phones").glob("*.parquet")):
        target = home / "rewritten"
        what = "* REPLACE (if(serial = 'Sc2' AND kind = 'result', 'X', serial) AS serial)"
        duckdb.sql(f"COPY (SELECT {what} FROM '{file}') TO '{target}' (FORMAT parquet)")
        file.unlink()
        target.rename(file.with_name(f"{hashlib.sha256(target.read_bytes()).hexdigest()}.parquet"))


def restored(home: Path) -> None:
    """An old backup takes the place of the registry."""
    shutil.rmtree(home / "phones")
    shutil.copytree(home / "backup", home / "phones")


def strange(home: Path) -> None:
    """A file of somebody else in the folder."""
    (home / "phones" / "notes.txt").write_text("dear")


LOSSES: dict[str, Callable[[Path], None]] = {
    **{f"file {number}": gone("phones/*.parquet", number) for number in range(9)},
    "the records of a batch": holder("kind = 'result' AND serial = 'Sc1'"),
    "the first list": holder("kind = 'list' AND len(previous) = 0"),
    "a list between": holder("kind = 'list' AND record IN (SELECT previous[1] FROM stored WHERE kind = 'list') "
                             "AND len(previous) > 0"),
    "a row, by another program": by_another_program("serial = 'Sc1' AND kind = 'result'"),
    "a job, by another program": by_another_program("name = 'c2' AND kind = 'job'"),
    "row and job, by another program": by_another_program("name = 'c1'"),
    "all rows, by another program": by_another_program("kind = 'result'"),
    "a changed record": changed_by_another_program,
    "a flipped bit": edited(lambda data: data[:300] + bytes([data[300] ^ 4]) + data[301:]),
    "a cut file": edited(lambda data: data[:-500]),
    "an empty file": edited(lambda data: b""),
    "a damaged list": edited(lambda data: data[:-100] + bytes(100), "list"),
    "a strange file": strange,
    "a document": gone("out/*/*/result.json", 3),
    "a result's folder": gone("out/*/*"),
    "the archive": gone("out"),
    "an old backup of all": restored,
}  # fmt: skip
MOVED = ("a flipped bit", "a cut file", "an empty file", "a damaged list", "a strange file", "a changed record")
"""Losses after which a file is moved away, as the message says."""


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_is_noticed_and_a_batch_restores_it(home: Path, loss: str, capsys: pytest.CaptureFixture[str]) -> None:
    desk, verify = Desk(home, {}), ["registry", "verify", str(home / "phones")]
    before = desk.rows(WRITTEN)
    assert (cli.main(verify), desk.run().resumed) == (0, 6)
    capsys.readouterr()
    restored_files = home.parent / "copy" / "phones"
    shutil.rmtree(home / "phones")
    shutil.copytree(restored_files, home / "phones")
    LOSSES[loss](home)
    assert cli.main(verify) == cli.PARTED
    output = capsys.readouterr()
    faults = json.loads(output.out)["faults"]
    assert faults
    assert "damaged: " in output.err
    if loss in MOVED:
        (named,) = {fault.partition(" ")[0].removesuffix(":") for fault in faults if str(home / "phones") in fault}
        Path(named).rename(home / "moved away")
    summary = desk.run()
    assert (summary.total, summary.failed) == (6, 0)
    assert desk.rows(WRITTEN) == before
    assert cli.main(verify) == 0, capsys.readouterr().err
    again = desk.run()
    assert (again.resumed, again.added) == (6, 0)


@pytest.mark.requirement("R-REGISTRY")
def test_a_backup_is_laid_over_by_copying_what_lacks(home: Path) -> None:
    """After any loss, and after anything that was written since."""
    desk = Desk(home, {})
    before = desk.rows(WRITTEN)
    shutil.copytree(home / "phones", home / "whole")
    holder("kind = 'list'")(home)
    for file in sorted((home / "phones").iterdir())[:2]:
        file.unlink()
    for file in (home / "whole").iterdir():
        if not (home / "phones" / file.name).exists():
            shutil.copy(file, home / "phones")
    assert desk.rows(WRITTEN) == before
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0
    Registry(home / "phones").files.compact()
    shutil.copytree(home / "whole", home / "phones", dirs_exist_ok=True)
    assert desk.rows(WRITTEN) == before, "each record twice, which counts once"
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0


@pytest.mark.requirement("R-REGISTRY")
def test_a_head_notices_an_old_copy_that_is_whole(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    verify = ["registry", "verify", str(home / "phones")]
    capsys.readouterr()
    assert cli.main(verify) == 0
    (head,) = json.loads(capsys.readouterr().out)["heads"]
    assert cli.main([*verify, "--head", head]) == 0
    assert cli.main([*verify, "--head", head[:12]]) == 0
    restored(home)
    shutil.rmtree(home / "out")  # the archive knows, too
    capsys.readouterr()
    assert cli.main([*verify, "--head", head]) == cli.PARTED
    faults = json.loads(capsys.readouterr().out)["faults"]
    assert any(f"the list {head[:12]} given as head is missing" in fault for fault in faults)


def test_a_row_that_no_archive_has_stays_named(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever is written to the registry after its loss; until it is added again."""
    from camssf.documents.document import document_bytes
    from tests.support.documents import document

    (home / "result.json").write_bytes(document_bytes(document()))
    add = ["registry", "add", str(home / "phones"), str(home / "result.json"), "--serial", "X"]
    verify = ["registry", "verify", str(home / "phones")]
    assert (cli.main(add), cli.main(verify)) == (0, 0)
    holder("kind = 'result' AND serial = 'X'")(home)
    Desk(home, {}).run()
    capsys.readouterr()
    assert cli.main(verify) == cli.PARTED
    (fault,) = json.loads(capsys.readouterr().out)["faults"]
    assert fault.startswith("the record ")
    assert fault.endswith(" is missing")
    assert (cli.main(add), cli.main(verify)) == (0, 0)


def test_a_deleted_unit_is_not_missed(home: Path) -> None:
    """Its document remains in the archive."""
    assert cli.main(["registry", "delete", str(home / "phones"), "Sc2"]) == 0
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0
    assert Desk(home, {}).run().added == 1, "as the manifest has it still"
    assert len(Desk(home, {}).rows()) == 6
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0


def unreadable(job: Job, folder: Path) -> Outcome:
    """As the calibration does it: a photo that cannot be read gives a refusal with a document."""
    if Path(job.photos[0]).exists() and Path(job.photos[0]).read_text() != "torn":
        return stub(job, folder)
    refused = json.loads((Path(job.photos[0]).parent / "template-True.json").read_text("utf-8"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(json.dumps(refused), "utf-8")
    return Outcome(job.name, "refused", UnreadableRaw.code, f"{job.photos[0]} cannot be read.")


def without(job: Job, folder: Path) -> Outcome:
    """A file of the job is missing, so there is no document."""
    if Path(job.photos[0]).exists():
        return stub(job, folder)
    raise InvalidArgument(f"{job.photos[0]} is missing.", "Name another file.")


def torn(photo: Path) -> None:
    photo.write_text("torn")


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("lost", ["a file of records", "all results", "nothing"])
@pytest.mark.parametrize(
    ("fault", "work"), [(Path.unlink, unreadable), (torn, unreadable), (Path.unlink, without)]
)  # fmt: skip
def test_a_lost_row_comes_back_without_its_photo(
    home: Path, lost: str, fault: Callable[[Path], None], work: WorkInFolder
) -> None:
    """The photo is said, and no refusal takes the place of a result with curves."""
    desk = Desk(home, {})
    before = desk.rows(WRITTEN)
    if lost == "a file of records":
        holder("serial = 'Sc2' AND kind = 'result'")(home)
    elif lost == "all results":
        holder("kind = 'result'")(home)
    fault(home / "c2")
    for resumed in ({"a file of records": 4, "all results": 0, "nothing": 5}[lost], 6):
        found = desk.run(work=work)
        assert (found.total, found.failed, found.resumed) == (6, 1, resumed)
        (said,) = [words for code, words in found.examples.items() if found.by_code[code] == 1]
        assert said.startswith(f"c2: {home / 'c2'} ")
        assert said.endswith("The earlier result of this name was kept as it is.")
        assert desk.rows(WRITTEN) == before
        assert cli.main(["registry", "verify", str(home / "phones")]) == 0
    (home / "c2").unlink(missing_ok=True)
    (home / "c3").write_text("torn")
    found = desk.run(work=unreadable)
    assert found.by_status == {"doubtful": 4, "refused": 2}
    (home / "c2").write_text("Phone c2")
    found = desk.run(work=unreadable)
    assert (found.by_code[UnreadableRaw.code], found.examples[UnreadableRaw.code][:4]) == (1, "c3: ")
    assert desk.run(work=unreadable).examples == found.examples  # of today's tasks, not of earlier ones
    (home / "c2").unlink()
    (home / "c3").write_text("Phone c3")
    text = "c2,c2,D55,,,,Other,lab"  # of another row the archive has no result
    (home / "manifest.csv").write_text((home / "manifest.csv").read_text().replace("c2,c2,D55,,,,Sc2,lab", text))
    found = desk.run(work=without)
    assert (found.failed, found.added) == (1, 0)
    assert "kept" not in "".join(found.examples.values())
    assert desk.rows(WRITTEN) == before


def test_what_was_added_to_a_changed_row_stays(home: Path) -> None:
    """Of such a row the batch's words count; what it does not say is kept."""
    (result,) = [path for path in home.glob("out/*/*/result.json") if "Phone c2" in path.read_text("utf-8")]
    add = ["registry", "add", str(home / "phones"), str(result), "--lens", "50mm"]
    assert cli.main(add) == 0
    holder("serial = 'Sc2' AND kind = 'result'")(home)
    assert Desk(home, {}).run().failed == 0
    assert Desk(home, {}).rows("serial, lens")[2] == {"serial": "Sc2", "lens": "50mm"}
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0
    assert cli.main(add) == 0


def test_paths_are_told_without_detours(
    home: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Unless a link leads elsewhere."""
    monkeypatch.chdir(home)
    gone("out/*/*/result.json")(home)
    capsys.readouterr()
    assert cli.main(["registry", "verify", "phones"]) == cli.PARTED
    (fault,) = json.loads(capsys.readouterr().out)["faults"]
    assert fault.startswith("out/")
    (home / "else").mkdir()
    (home / "else" / "link").symlink_to(home / "phones")
    assert cli.main(["registry", "verify", "else/link"]) == cli.PARTED
    assert len(json.loads(capsys.readouterr().out)["faults"]) == 1


def test_of_a_damaged_file_all_say_the_same(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    LOSSES["a cut file"](home)
    capsys.readouterr()
    assert cli.main(["registry", "verify", str(home / "phones")]) == cli.PARTED
    advice = json.loads(capsys.readouterr().out)["advice"]
    with pytest.raises(InvalidArgument, match="damaged or missing") as raised:
        Desk(home, {}).run()
    assert raised.value.advice == DAMAGED
    for words in ("away", "backup", "camssf batch"):
        assert words in advice
        assert words in DAMAGED
