"""`camssf passport`: signed, shown, verified, called back; no secret is told, no large file read."""

import hashlib
import io
import json
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from camssf import cli
from camssf.documents import forms
from camssf.documents.document import Document
from camssf.errors import InvalidArgument, PassportInvalid

pytest.importorskip("cryptography", reason="cryptography is not here")
pytest.importorskip("joserfc", reason="joserfc is not here")

from camssf_fleet.passport.document import FORMAT
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, make_key, read_private, read_public
from camssf_fleet.passport.revocations import read_revoked
from tests.support.documents import document
from tests.support.fixed_passports import result_json
from tests.support.signed_passports import b64, unb64


@pytest.fixture
def desk(tmp_path: Path) -> Path:
    """A folder with a result, a pair of keys and a passport."""
    (tmp_path / "result.json").write_bytes(result_json())
    result, private, out = (str(tmp_path / name) for name in ("result.json", PRIVATE, "camera.jws"))
    for words in (
        ["key", "-o", str(tmp_path)],
        ["sign", result, "--key", private, "--serial", "A1", "--days", "90", "-o", out],
    ):
        assert cli.main(["passport", *words]) == 0
    return tmp_path


@dataclass
class Done:
    returncode: int
    stdout: bytes
    stderr: bytes


def run(folder: Path, *words: str, stdin: bytes = b"") -> Done:
    """The command in this folder: what it reads and writes is bytes, as in a process of its own."""
    out, err, entered = (io.TextIOWrapper(io.BytesIO(data), "utf-8") for data in (b"", b"", stdin))
    with chdir(folder), redirect_stdout(out), redirect_stderr(err), pytest.MonkeyPatch.context() as patched:
        patched.setattr("sys.stdin", entered)
        status = cli.main(["passport", *words])
    out.flush()
    err.flush()
    return Done(status, out.buffer.getvalue(), err.buffer.getvalue())


def test_sign_verify_show(desk: Path) -> None:
    data, whole = (desk / "camera.jws").read_bytes(), forms.read(result_json(), Document, "it", "")
    for words, stdin in ((["camera.jws"], b""), (["-"], data)):
        done = run(desk, "verify", *words, "--key", PUBLIC, "--result", "result.json", stdin=stdin)
        assert done.returncode == 0, done.stderr
        sha256, excerpt = hashlib.sha256(result_json()).hexdigest(), excerpt_of(whole)
        assert json.loads(done.stdout) == dict(forms.to_plain(excerpt)) | {
            "excerpt": {"result_sha256": sha256, "passport": data.decode()}
        }
        again = run(desk, "verify", "-", "--key", PUBLIC, stdin=done.stdout)
        assert (again.returncode, again.stdout) == (0, done.stdout), again.stderr
    shown = run(desk, "show", "camera.jws")
    shown_claims = json.loads(shown.stdout)
    assert (shown_claims["verified"], shown_claims["format"], shown_claims["unit"]["serial"]) == (False, FORMAT, "A1")
    assert shown_claims["verdict"] == document().verdict.status
    assert b"not verified" in shown.stderr
    (desk / "revoked.txt").write_text(shown_claims["id"])
    assert run(desk, "revoke", shown_claims["id"], "--key", PRIVATE, "-o", "revoked.jws").returncode == 0
    for more in (["--revoked", "revoked.jws"], ["--revoked", "revoked.txt"], ["--result", PUBLIC]):
        done = run(desk, "verify", "camera.jws", "--key", PUBLIC, *more)
        assert (done.returncode, done.stdout) == (PassportInvalid.exit_status, b""), more
        assert b"passport_invalid" in done.stderr
    done = run(desk, "verify", "camera.jws", "--key", PUBLIC, "--revoked", "missing.txt")
    assert (done.returncode, done.stdout) == (InvalidArgument.exit_status, b"")


@pytest.mark.full
def test_the_private_key_is_nowhere(desk: Path) -> None:
    """In no output, no passport, no traceback; and no passphrase either."""
    (desk / "phrase").write_text("correct horse\n")
    assert run(desk, "--passphrase", "phrase", "key", "-o", "locked").returncode == 0
    private = (desk / PRIVATE).read_bytes()
    number = read_private(desk / PRIVATE).private_numbers().private_value
    secrets = [line for line in private.splitlines() if b"-----" not in line]
    secrets += [str(number).encode(), f"{number:x}".encode(), b64(number.to_bytes(32, "big")), b"correct horse"]
    (desk / "broken.pem").write_bytes(private[:120] + b"!" + private[120:])
    locked = ["sign", "result.json", "--key", f"locked/{PRIVATE}", "-o", "b.jws", "--debug"]
    said = b""
    for words, status in (
        (["sign", "result.json", "--key", PRIVATE, "-o", "a.jws", "--debug"], 0),
        (["--passphrase", "phrase", *locked], 0),
        (locked, 2),
        (["--passphrase", "result.json", *locked], 2),
        (["sign", "result.json", "--key", "broken.pem", "-o", "c.jws", "--debug"], 2),
        (["sign", "result.json", "--key", PRIVATE, "-o", "no/where.jws", "--debug"], 2),
        (["verify", "camera.jws", "--key", PRIVATE, "--debug"], 2),
        (["show", PRIVATE, "--debug"], 10),
    ):
        done = run(desk, *words)
        assert done.returncode == status, (words, done.stderr)
        said += done.stdout + done.stderr
    for name in ("a.jws", "b.jws", "camera.jws"):
        said += (desk / name).read_bytes() + b"".join(map(unb64, (desk / name).read_bytes().split(b".")))
    assert len(secrets) >= 7
    assert not [secret for secret in secrets if secret in said]


def test_a_list_is_renewed(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing that was called back is lost: a list that exists is extended, if this key signed it."""
    files = [str(desk / "revoked.jws"), str(desk / PRIVATE), str(desk / PUBLIC)]
    here, private, public = files
    call = ["passport", "revoke", "--key", private, "-o", here]
    assert cli.main(call) == InvalidArgument.exit_status  # nothing is called back
    assert cli.main([*call, "x"]) == InvalidArgument.exit_status
    assert cli.main([*call, "f" * 32]) == 0
    assert cli.main(call) == 0  # dated anew
    assert cli.main([*call, "e" * 32]) == 0
    hyphen = "-I" + "o" * 41  # a key's name may look like options
    assert cli.main([*call, hyphen, "--days", "1"]) == 0
    assert cli.main([*call, "--", "-" + "k" * 42]) == 0
    keys = read_public([public])
    assert read_revoked((desk / "revoked.jws").read_bytes(), keys) == {"e" * 32, "f" * 32, hyphen, "-" + "k" * 42}
    (desk / "own").mkdir()
    make_key(desk / "own")
    before = (desk / "revoked.jws").read_bytes()
    strange = ["passport", "revoke", "f" * 32, "--key", str(desk / "own" / PRIVATE), "-o", here]
    assert cli.main(strange) == PassportInvalid.exit_status
    capsys.readouterr()
    for other in (private, str(desk / "camera.jws")):
        kept = Path(other).read_bytes()
        assert cli.main([*call[:-1], other, "f" * 32]) in (InvalidArgument.exit_status, PassportInvalid.exit_status)
        assert Path(other).read_bytes() == kept
    assert (desk / "revoked.jws").read_bytes() == before


def test_what_was_printed_serves_as_a_result_where_an_excerpt_will_do(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    public, data = str(desk / PUBLIC), str(desk / "y.json")
    assert cli.main(["passport", "verify", str(desk / "camera.jws"), "--key", public]) == 0
    (desk / "y.json").write_text(capsys.readouterr().out, "utf-8")
    for form in ("csv", "icc"):
        assert cli.main(["export", data, "--to", form, "-o", str(desk / f"y.{form}")]) == 0
    assert hashlib.sha256(result_json()).hexdigest() in (desk / "y.csv").read_text("utf-8")
    capsys.readouterr()
    for words in (
        ["report", data, "-o", str(desk / "out")],
        ["passport", "sign", data, "--key", str(desk / PRIVATE), "-o", "x"],
    ):
        capsys.readouterr()
        assert cli.main(words) == InvalidArgument.exit_status
        assert "whole result.json, of SHA-256" in " ".join(capsys.readouterr().err.split())


def test_two_hundred_megabytes(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever place: the documented status, soon, since no more is read than may be there."""
    with open(desk / "huge", "wb") as file:
        file.write(b"{")
        file.truncate(200 * 10**6)
    (desk / "huge").chmod(0o600)
    monkeypatch.chdir(desk)
    for words, status in (
        (["verify", "-", "--key", PUBLIC], 10),
        (["verify", "camera.jws", "--key", PUBLIC, "--revoked", "huge"], 10),
        (["verify", "camera.jws", "--key", "huge"], 2),
        (["sign", "huge", "--key", PRIVATE, "-o", "x.jws"], 2),
        (["--passphrase", "huge", "sign", "result.json", "--key", PRIVATE, "-o", "x.jws"], 2),
    ):
        with open("huge", "rb") as file, io.TextIOWrapper(file) as text:
            monkeypatch.setattr("sys.stdin", text)
            assert cli.main(["passport", *words]) == status, words
    with open("huge", "r+b") as file:
        file.write(b"A.")
    for words in (["verify", "huge", "--key", PUBLIC], ["show", "huge"]):
        assert cli.main(["passport", *words]) == 10, words
    assert not (desk / "x.jws").exists()
