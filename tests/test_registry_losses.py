"""What is removed from a registry or its archive is noticed, and a batch writes again what the archive has."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from test_stream import Desk, made_templates, stub

from camssf import cli

pytest.importorskip("duckdb", reason="duckdb is not here")
pytest.importorskip("deltalake", reason="deltalake is not here")

from deltalake import DeltaTable, write_deltalake

from camssf.errors import InvalidArgument, UnreadableRaw
from camssf_fleet.batch import WorkInFolder
from camssf_fleet.manifest import Job
from camssf_fleet.outcome import Outcome
from camssf_fleet.registry import DAMAGED, FOLDERS, Registry
from camssf_fleet.rows import Row, Task
from camssf_fleet.tables import Table
from camssf_fleet.upkeep import optimize, seal_commits

NAMES = [f"c{number}" for number in range(6)]
WRITTEN = "name, serial, captured, model, key, made_from, extra"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three batches of two cameras each; a copy of the registry before the last."""

    home = tmp_path_factory.mktemp("made") / "home"
    home.mkdir()
    desk = Desk(home, made_templates())
    for count in (2, 4, 6):
        if count == 6:
            shutil.copytree(home / "phones", home / "backup")
        rows = [f"{name},{name},D55,,,,S{name},lab" for name in NAMES[:count]]
        desk.write(rows, {name: f"Phone {name}" for name in NAMES[:count]})
        desk.run()
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


def by_delta(table: str, where: str | None) -> Callable[[Path], None]:
    """Another program deletes rows."""
    return lambda home: DeltaTable(str(home / "phones" / table)).delete(where) and None


def overwritten(home: Path) -> None:
    """Another program writes the table anew, with a part of its rows as they were."""
    table = DeltaTable(str(home / "phones" / "results"))
    from deltalake import QueryBuilder

    rows = QueryBuilder().register("t", table).execute("SELECT * FROM t WHERE serial <> 'Sc3'").read_all()
    write_deltalake(table, rows, mode="overwrite")


def compacted_and_deleted(home: Path) -> None:
    by_delta("results", "serial = 'Sc1'")(home)
    DeltaTable(str(home / "phones" / "results")).optimize.compact()


def gone(pattern: str, which: int = 0) -> Callable[[Path], None]:
    """A file or a folder is removed."""

    def remove(home: Path) -> None:
        path = sorted(home.glob(pattern))[which]
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return remove


def data(table: Table, *, active: bool) -> Callable[[Path], None]:
    """A data file of the newest version, or one that only older versions have."""

    def remove(home: Path) -> None:
        registry = Registry(home / "phones")
        needed = set(map(Path, registry.files(table)))
        sorted(needed if active else set((home / "phones" / FOLDERS[table]).rglob("*.parquet")) - needed)[0].unlink()

    return remove


def restored(*tables: str) -> Callable[[Path], None]:
    """An old backup takes the place of tables."""

    def replace(home: Path) -> None:
        for table in tables:
            shutil.rmtree(home / "phones" / table)
            shutil.copytree(home / "backup" / table, home / "phones" / table)

    return replace


def several(*losses: Callable[[Path], None]) -> Callable[[Path], None]:
    return lambda home: [loss(home) for loss in losses] and None


LOSSES: dict[str, Callable[[Path], None]] = {
    "a row, by Delta": by_delta("results", "serial = 'Sc1'"),
    "all rows, by Delta": by_delta("results", None),
    "a task, by Delta": by_delta("tasks", "name = 'c2'"),
    "row and task, by Delta": several(by_delta("results", "serial = 'Sc1'"), by_delta("tasks", "name = 'c1'")),
    "all tasks, by Delta": by_delta("tasks", None),
    "rows, by an overwriting": overwritten,
    "a row, then compacted": compacted_and_deleted,
    "a data file of results": data(Row, active=True),
    "the data of a model": gone("phones/results/make=*/model=*", 1),
    "a data file of tasks": data(Task, active=True),
    "a data file of an old version": data(Task, active=False),
    "the last log entry": gone("phones/results/_delta_log/*.json", -1),
    "a log entry between": gone("phones/results/_delta_log/*.json", 2),
    "the first log entry": gone("phones/results/_delta_log/*.json"),
    "the last log entry of tasks": gone("phones/tasks/_delta_log/*.json", -1),
    "the log": gone("phones/results/_delta_log"),
    "the first seal": gone("phones/results/_seals/*"),
    "the last seal": gone("phones/results/_seals/*", -1),
    "a seal of tasks": gone("phones/tasks/_seals/*", 1),
    "the seals": gone("phones/results/_seals"),
    "a document": gone("out/*/*/result.json", 3),
    "a result's folder": gone("out/*/*"),
    "the archive": gone("out"),
    "the results": gone("phones/results"),
    "the tasks": gone("phones/tasks"),
    "an old backup of all": restored("results", "tasks"),
    "an old backup of the results": restored("results"),
    "an old backup of the tasks": restored("tasks"),
    "a seal and its row": several(by_delta("results", "serial = 'Sc1'"), gone("phones/results/_seals/*", -1)),
}
UNREADABLE = {"a log entry between", "the first log entry", "the log"}
"""Without them nobody reads the table; a new registry is made from the archive."""


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("loss", LOSSES)
def test_a_loss_is_noticed_and_a_batch_restores_it(home: Path, loss: str, capsys: pytest.CaptureFixture[str]) -> None:
    desk, verify = Desk(home, {}), ["registry", "verify", str(home / "phones")]
    before = desk.rows(WRITTEN)
    assert (cli.main(verify), desk.run().resumed) == (0, 6)
    capsys.readouterr()
    LOSSES[loss](home)
    assert cli.main(verify) == cli.PARTED
    output = capsys.readouterr()
    assert json.loads(output.out)["faults"]
    assert "damaged: " in output.err
    if loss in UNREADABLE:
        with pytest.raises(InvalidArgument, match="the registry cannot be used"):
            desk.run()
        shutil.rmtree(home / "phones")
    found = desk.run()
    assert (found.total, found.failed) == (6, 0)
    assert desk.rows(WRITTEN) == before
    if loss == "a data file of an old version":
        assert cli.main(["registry", "vacuum", str(home / "phones"), "--days", "0"]) == 0
    assert cli.main(verify) == 0, capsys.readouterr().err
    again = desk.run()
    assert (again.resumed, again.added) == (6, 0)


def test_a_row_that_no_archive_has_stays_named(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever is written to the registry after its loss; until it is added again."""
    from documents import document

    from camssf.documents.document import document_bytes

    (home / "result.json").write_bytes(document_bytes(document()))
    add = ["registry", "add", str(home / "phones"), str(home / "result.json"), "--serial", "X"]
    verify = ["registry", "verify", str(home / "phones")]
    assert (cli.main(add), cli.main(verify)) == (0, 0)
    by_delta("results", "serial = 'X'")(home)
    Desk(home, {}).run()
    capsys.readouterr()
    assert cli.main(verify) == cli.PARTED
    (fault,) = json.loads(capsys.readouterr().out)["faults"]
    assert "results: the row " in fault
    assert "is missing" in fault
    assert (cli.main(add), cli.main(verify)) == (0, 0)


def test_a_deleted_unit_is_not_missed(home: Path) -> None:
    """Its document remains in the archive."""
    assert cli.main(["registry", "delete", str(home / "phones"), "--serial", "Sc2"]) == 0
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
@pytest.mark.parametrize("lost", ["a row", "a model's data", "nothing"])
@pytest.mark.parametrize(
    ("fault", "work"), [(Path.unlink, unreadable), (torn, unreadable), (Path.unlink, without)]
)  # fmt: skip
def test_a_lost_row_comes_back_without_its_photo(
    home: Path, lost: str, fault: Callable[[Path], None], work: WorkInFolder
) -> None:
    """The photo is said, and no refusal takes the place of a result with curves."""
    desk = Desk(home, {})
    before = desk.rows(WRITTEN)
    if lost == "a row":
        by_delta("results", "serial = 'Sc2'")(home)
    elif lost == "a model's data":
        gone("phones/results/make=*/model=*", 2)(home)
    fault(home / "c2")
    for resumed in (5, 6):
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


def changed(table: str, where: str, **values: str) -> Callable[[Path], None]:
    """Another program changes rows."""
    return lambda home: DeltaTable(str(home / "phones" / table)).update(predicate=where, updates=values) and None


def changed_and_compacted(home: Path) -> None:
    changed("results", "name = 'c1'", lens="'X'")(home)
    registry = Registry(home / "phones")
    seal_commits(registry)
    optimize(registry)


CHANGES: dict[str, Callable[[Path], None]] = {
    "the serial": changed("results", "serial = 'Sc2'", serial="'X'"),
    "the verdict of all": changed("results", "true", status="'accepted'", code="'X'"),
    "the model": changed("results", "name = 'c3'", model="'X'"),
    "a number": changed("results", "name = 'c3'", half_width="0.5"),
    "the time of adding": changed("results", "name = 'c3'", added="'2020-01-01T00:00:00Z'"),
    "an empty field": changed("results", "name = 'c3'", passport="'X'"),
    "a value is emptied": changed("results", "name = 'c3'", serial="''"),
    "the checksum": changed("results", "name = 'c3'", checksum="'0'"),
    "sealed and compacted since": changed_and_compacted,
    "a task": changed("tasks", "name = 'c5'", status="'refused'", code="'X'"),
}


@pytest.mark.requirement("R-REGISTRY")
@pytest.mark.parametrize("change", CHANGES)
def test_a_batch_writes_changed_rows_again(home: Path, change: str) -> None:
    desk, verify = Desk(home, {}), ["registry", "verify", str(home / "phones")]
    before, tasks = desk.rows(WRITTEN), desk.tasks()
    CHANGES[change](home)
    assert cli.main(verify) == cli.PARTED
    found = desk.run()
    assert (found.total, found.failed) == (6, 0)
    assert (desk.rows(WRITTEN), desk.tasks()) == (before, tasks)
    assert cli.main(verify) == 0
    assert desk.run().resumed == 6


def test_what_was_added_to_a_changed_row_stays(home: Path) -> None:
    """Of such a row the batch's words count; what it does not say is kept."""
    (result,) = [path for path in home.glob("out/*/*/result.json") if "Phone c2" in path.read_text("utf-8")]
    add = ["registry", "add", str(home / "phones"), str(result), "--lens", "50mm"]
    assert cli.main(add) == 0
    changed("results", "serial = 'Sc2'", serial="'X'")(home)
    assert Desk(home, {}).run().failed == 0
    assert Desk(home, {}).rows("serial, lens")[2] == {"serial": "Sc2", "lens": "50mm"}
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0
    assert cli.main(add) == 0


@pytest.mark.parametrize("loss", sorted(UNREADABLE))
@pytest.mark.parametrize("table", ["results", "tasks"])
def test_of_an_unreadable_log_all_say_the_same(
    home: Path, table: str, loss: str, capsys: pytest.CaptureFixture[str]
) -> None:
    log = home / "phones" / table / "_delta_log"
    shutil.rmtree(log) if loss == "the log" else sorted(log.glob("*.json"))[loss == "a log entry between"].unlink()
    capsys.readouterr()
    assert cli.main(["registry", "verify", str(home / "phones")]) == cli.PARTED
    messages = [" ".join(capsys.readouterr().err.split())]
    words = ["batch", str(home / "manifest.csv"), "-o", str(home / "out"), "--registry", str(home / "phones")]
    assert cli.main(words) == InvalidArgument.exit_status
    messages.append(" ".join(capsys.readouterr().err.split()))
    for text in messages:
        assert str(log) in text
        assert DAMAGED in text
        assert text.count("camssf batch") == 1
        assert "vacuum" not in text
        assert "ernel" not in text
        assert "{" not in text
        assert "has no" not in text, "nothing that follows from it"


def test_a_file_of_old_versions_asks_for_no_batch(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data(Task, active=False)(home)
    capsys.readouterr()
    assert cli.main(["registry", "verify", str(home / "phones")]) == cli.PARTED
    message = capsys.readouterr().err
    assert "camssf registry vacuum" in message
    assert "batch" not in message
    assert cli.main(["registry", "vacuum", str(home / "phones")]) == 0
    assert cli.main(["registry", "verify", str(home / "phones")]) == 0


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


@pytest.mark.parametrize("table", [Row, Task])
def test_of_a_damaged_file_all_say_the_same(home: Path, table: Table, capsys: pytest.CaptureFixture[str]) -> None:
    file = Path(next(iter(Registry(home / "phones").files(table))))
    file.write_bytes(file.read_bytes()[:-100] + bytes(100))
    capsys.readouterr()
    assert cli.main(["registry", "verify", str(home / "phones")]) == cli.PARTED
    assert json.loads(capsys.readouterr().out)["advice"] == DAMAGED
    with pytest.raises(InvalidArgument, match="damaged or missing") as raised:
        Desk(home, {}).run()
    assert raised.value.advice == DAMAGED
