"""Object storage, on a real server over HTTP: everything of a fleet is there, whole, whatever the network does."""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument
from tests.fleet.conftest import Said
from tests.support.desk import HEADER, Desk, stub
from tests.support.documents import document
from tests.support.registries import bells, keys, made, writing
from tests.support.stores import SECRET, Faulty, served

pytest.importorskip("moto", reason="moto is not here")
pytest.importorskip("s3fs", reason="s3fs is not here")

from camssf.photo.read.unit import Unit
from camssf.places import files_below, join, place, relative
from camssf_fleet import batch
from camssf_fleet.manifest import Manifest
from camssf_fleet.outcome import Summary
from camssf_fleet.registry import Deleted, Deletion, Registry
from camssf_fleet.verification import verify

# Warnings of moto, botocore and aiohttp are not ours to mend.
pytestmark = [pytest.mark.full, pytest.mark.filterwarnings("default")]
NAMES = [f"c{i}" for i in range(4)]


@pytest.fixture(scope="module")
def server() -> Iterator[Faulty]:
    with served() as found:
        yield found


@pytest.fixture
def bucket(server: Faulty, request: pytest.FixtureRequest) -> Iterator[str]:
    import s3fs

    name = f"b{abs(hash(request.node.name)) % 10**9}"
    s3fs.S3FileSystem(use_listings_cache=False).mkdir(name)
    yield f"s3://{name}"
    server.rate = 0.0


def ran(home: str, log: Path) -> Summary:
    """A batch whose visits are kept here: the folder of a photo from a bucket is a temporary one."""
    registry, work = Registry(f"{home}/phones", new=True), partial(stub, log=log)
    return batch.run_batch(Manifest(f"{home}/manifest.csv"), f"{home}/out", registry, workers=2, work=work)


def test_a_registry_does_there_what_it_does_in_a_folder(bucket: str) -> None:
    one = Registry(f"{bucket}/deep/phones", new=True)
    one.add([made(1, bells()), made(2, model="É =/%'?*"), made(3, make="")])
    files = one.files.sizes()
    one.add([made(1, bells())])
    assert one.files.sizes() == files
    Registry(one.folder, correct=True).add([made(1, bells(), serial="B2"), made(4)])
    assert len(keys(one)) == 4
    assert [each["key"][-1] for each in one.listing()][:2] == ["4", "3"]
    one.files.compact()
    assert one.delete(Unit(serial="B2")) == Deletion((Deleted(f"{1:064x}", ""),), records=2, files=1)
    found = verify(one)
    assert (found.rows, found.faults) == (3, ())
    file = place(next(iter(one.files.sizes())))
    whole = file.read_bytes()
    file.write_bytes(whole[:200] + bytes([whole[200] ^ 1]) + whole[201:])
    assert verify(one).faults


@pytest.mark.requirement("R-REGISTRY")
def test_writers_at_once_two_of_them_killed(bucket: str) -> None:
    rows = {number: 10 if number > 2 else 1_000_000 for number in range(1, 5)}
    added: list[str] = []
    with writing(f"{bucket}/phones", rows) as writers:
        for victim in writers[:2]:
            added += [victim.stdout.readline().decode().strip()]
            victim.kill()
        for process in writers:
            added += process.communicate(timeout=240)[0].decode().split()
    one = Registry(f"{bucket}/phones")
    found = keys(one)
    assert len(found) == len(set(found))
    assert set(added) <= set(found)
    one.list_records()  # those of the killed
    assert verify(one).faults == ()


def test_a_batch_from_a_bucket_to_a_bucket_whatever_fails(bucket: str, server: Faulty, tmp_path: Path) -> None:
    """One answer in four is throttled, an error or cut; then the same command is given until it ends."""
    for name in NAMES:
        place(f"{bucket}/photos/{name}").write_text(f"Phone {name}")
    rows = [f"{name},photos/{name},D55,,,,S{name}," for name in NAMES]
    place(f"{bucket}/manifest.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    server.rate, before = 0.25, server.faults
    for _ in range(20):
        with suppress(InvalidArgument):
            if ran(bucket, tmp_path).by_status == {"doubtful": 4}:
                break
    else:
        pytest.fail("it never ended")
    server.rate, visits = 0.0, Desk(tmp_path).visits()
    assert server.faults > before + 5
    again = ran(bucket, tmp_path)
    assert (again.by_status, again.resumed) == ({"doubtful": 4}, 4)
    assert Desk(tmp_path).visits() == visits
    one = Registry(f"{bucket}/phones")
    stored = one.query("SELECT name, place FROM rows ORDER BY name")
    assert [(row["name"], row["place"][:7]) for row in stored] == [(name, "../out/") for name in NAMES]
    checked = verify(one)
    assert (checked.rows, checked.documents, checked.documents_missing, checked.faults) == (4, 4, 0, ())
    place(f"{bucket}/photos/c0").write_text("Phone other")  # another photo of the same name
    place(f"{bucket}/photos/c1").unlink()
    once_more = ran(bucket, tmp_path)
    assert (once_more.resumed, once_more.by_status) == (2, {"doubtful": 3, "refused": 1})
    (reason,) = one.query("SELECT reason FROM jobs WHERE name = 'c1' AND status = 'refused'")
    assert f"{bucket}/photos/c1 cannot be read" in reason["reason"]
    assert not [path for path in files_below(place(f"{bucket}/out")) if path.name not in ("result.json",)]


def test_on_the_command_line(bucket: str, tmp_path: Path, monkeypatch: Any, said: Said, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    phones, other = f"{bucket}/phones", f"{bucket}/results/other.json"
    (tmp_path / "result.json").write_bytes(document_bytes(document()))
    place(other).write_bytes(document_bytes(document("A")))
    printed = [*said("add", phones, "result.json", other, "--serial", "A1")]
    found = {each["place"] for each in Registry(phones).query("SELECT place FROM rows")}
    assert found == {str(tmp_path / "result.json"), "../results/other.json"}
    for words in (["list"], ["verify"], ["compact"], ["history", "A1"], ["export", "-o", "x.parquet"]):
        printed += said(words[0], phones, *words[1:])
    (tmp_path / "m.csv").write_text(f"name,photo,lamp\na,{bucket}/none.dng,D55\n")
    assert cli.main(["batch", "m.csv", "-o", f"{bucket}/out", "--registry", phones]) == cli.BATCH_FAILED
    printed += capsys.readouterr()
    for folder in (f"{bucket}/elsewhere", "s3://key:secret@bucket/phones"):
        printed += said("list", folder, status=InvalidArgument.exit_status)
    assert "key:secret" not in "".join(printed)
    assert SECRET not in "".join([*printed, *(path.read_text(errors="ignore") for path in tmp_path.iterdir())])
    for path in files_below(place(bucket)):
        assert SECRET.encode() not in path.read_bytes()


def test_a_server_that_is_gone_is_told(bucket: str, monkeypatch: pytest.MonkeyPatch, said: Said) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "another-secret-5678")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    type(place(bucket).fs).clear_instance_cache()  # it knows the server that is there
    message = said("list", f"{bucket}/phones", status=InvalidArgument.exit_status)[1]
    assert "cannot be used" in message
    assert "another-secret" not in message


def test_names_of_places() -> None:
    for folder, path, whole in (
        ("s3://b/a", "../x/y.json", "s3://b/x/y.json"), ("s3://b/a", "s3://c/d", "s3://c/d"),
        ("/a/b", "c", "/a/b/c"), ("s3://b", "c/d", "s3://b/c/d"),
    ):  # fmt: skip
        assert join(place(folder), path) == whole
    for file, folder, short in (
        ("s3://b/x/y.json", "s3://b/a", "../x/y.json"), ("s3://c/x", "s3://b/a", "s3://c/x"),
        ("s3://b/x", "/here", "s3://b/x"), ("/here/x", "s3://b/a", "/here/x"),
    ):  # fmt: skip
        assert relative(place(file), place(folder)) == short
    for wrong in ("s3://key:secret@b/a", "s3://b/a?token=secret", "az://b#secret"):
        with pytest.raises(InvalidArgument) as caught:
            place(wrong)
        assert "secret" not in caught.value.message
