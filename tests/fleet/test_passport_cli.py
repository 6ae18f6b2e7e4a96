"""`camssf passport`: signed, shown, verified, called back, of a fleet, too; no secret is told, no large file read."""

import hashlib
import io
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.documents import forms
from camssf.documents.document import Document, document_bytes
from camssf.errors import InvalidArgument, PassportInvalid, UnitDiffers
from camssf.photo.read import raw
from camssf.photo.read.unit import Unit
from camssf.verdict.reasons import Verdict
from camssf_colour import standard_colour
from camssf_fleet.passport.document import FORMAT, PassportRequest, create_passport, read, sign, verify
from camssf_fleet.passport.excerpt import excerpt_of
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, make_key, read_private, read_public
from camssf_fleet.passport.revocations import read_revoked
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify as verify_registry
from tests.cli.conftest import spoken, state
from tests.fleet.conftest import Said
from tests.support.captures import calibrated, photos
from tests.support.documents import document
from tests.support.signed_passports import b64, result_json, unb64


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a result, a pair of keys and a passport."""
    monkeypatch.chdir(tmp_path)
    Path("result.json").write_bytes(result_json())
    more = "--serial A1B2 --captured 2026-11-22T10:30:00+01:00 --days 90 -o camera.jws"
    for words in ("key -o .", f"sign result.json --key {PRIVATE} {more}"):
        assert cli.main(["passport", *words.split()]) == 0
    return tmp_path


def run(*words: str, stdin: bytes = b"") -> tuple[int, bytes, bytes]:
    return spoken(["passport", *words], stdin=stdin)


def test_sign_verify_show(desk: Path) -> None:
    data, whole = (desk / "camera.jws").read_bytes(), forms.read(result_json(), Document, "it", "")
    sha256, excerpt = hashlib.sha256(result_json()).hexdigest(), forms.to_plain(excerpt_of(whole))
    for words, stdin in ((["camera.jws"], b""), (["-"], data)):
        status, out, err = run("verify", *words, "--key", PUBLIC, "--result", "result.json", stdin=stdin)
        assert status == 0, err
        assert json.loads(out) == excerpt | {"excerpt": {"result_sha256": sha256, "passport": data.decode()}}
        assert run("verify", "-", "--key", PUBLIC, stdin=out)[:2] == (0, out)
    _, out, err = run("show", "camera.jws")
    shown = json.loads(out)
    assert (shown["verified"], shown["format"], shown["unit"]["serial"]) == (False, FORMAT, "A1B2")
    assert shown["verdict"] == document().verdict.status
    assert b"not verified" in err
    (desk / "revoked.txt").write_text(shown["id"])
    assert run("revoke", shown["id"], "--key", PRIVATE, "-o", "revoked.jws")[0] == 0
    for option, file, kind in (
        ("--revoked", "revoked.jws", PassportInvalid), ("--revoked", "revoked.txt", PassportInvalid),
        ("--result", PUBLIC, PassportInvalid), ("--revoked", "missing.txt", InvalidArgument),
    ):  # fmt: skip
        status, out, err = run("verify", "camera.jws", "--key", PUBLIC, option, file)
        assert (status, out, err.startswith(kind.code.encode())) == (kind.exit_status, b"", True), (option, file)


@pytest.mark.full
def test_the_private_key_is_nowhere(desk: Path) -> None:
    """In no output, no passport, no traceback; and no passphrase either."""
    (desk / "phrase").write_text("correct horse\n")
    assert run("--passphrase", "phrase", "key", "-o", "locked")[0] == 0
    private = (desk / PRIVATE).read_bytes()
    number = read_private(desk / PRIVATE).private_numbers().private_value
    secrets = [line for line in private.splitlines() if b"-----" not in line]
    secrets += [str(number).encode(), f"{number:x}".encode(), b64(number.to_bytes(32, "big")), b"correct horse"]
    (desk / "broken.pem").write_bytes(private[:120] + b"!" + private[120:])
    locked, said = f"sign result.json --key locked/{PRIVATE} -o b.jws", b""
    for words, expected in (
        (f"sign result.json --key {PRIVATE} -o a.jws", 0), (f"--passphrase phrase {locked}", 0), (locked, 2),
        (f"--passphrase result.json {locked}", 2), ("sign result.json --key broken.pem -o c.jws", 2),
        (f"sign result.json --key {PRIVATE} -o no/where.jws", 2), (f"verify camera.jws --key {PRIVATE}", 2),
        (f"show {PRIVATE}", 10),
    ):  # fmt: skip
        status, out, err = run(*words.split(), "--debug")
        assert status == expected, (words, err)
        said += out + err
    for name in ("a.jws", "b.jws", "camera.jws"):
        said += (desk / name).read_bytes() + b"".join(map(unb64, (desk / name).read_bytes().split(b".")))
    assert len(secrets) >= 7
    assert not [secret for secret in secrets if secret in said]


def test_a_list_is_renewed(desk: Path) -> None:
    """Nothing that was called back is lost: a list that exists is extended, if this key signed it."""
    list_, hyphen = desk / "revoked.jws", "-I" + "o" * 41  # a key's name may look like options

    def revoke(*words: str, key: str = PRIVATE, to: str = "revoked.jws") -> int:
        return run("revoke", "--key", key, "-o", to, *words)[0]

    for words in ([], ["x"]):  # nothing is called back
        assert revoke(*words) == InvalidArgument.exit_status
    # the second one dates it anew
    for words in (["f" * 32], [], ["e" * 32], [hyphen, "--days", "1"], ["--", "-" + "k" * 42]):
        assert revoke(*words) == 0
    assert read_revoked(list_.read_bytes(), read_public([PUBLIC])) == {"e" * 32, "f" * 32, hyphen, "-" + "k" * 42}
    make_key(desk / "own")
    before = list_.read_bytes()
    assert revoke("f" * 32, key=f"own/{PRIVATE}") == PassportInvalid.exit_status
    for other in (PRIVATE, "camera.jws"):
        kept = Path(other).read_bytes()
        assert revoke("f" * 32, to=other) in (InvalidArgument.exit_status, PassportInvalid.exit_status)
        assert Path(other).read_bytes() == kept
    assert list_.read_bytes() == before


def test_what_was_printed_serves_as_a_result_where_an_excerpt_will_do(desk: Path) -> None:
    Path("y.json").write_bytes(run("verify", "camera.jws", "--key", PUBLIC)[1])
    for form in ("csv", "icc"):
        assert cli.main(["export", "y.json", "--to", form, "-o", f"y.{form}"]) == 0
    assert hashlib.sha256(result_json()).hexdigest() in Path("y.csv").read_text("utf-8")
    for words in ("report y.json -o out", f"passport sign y.json --key {PRIVATE} -o x"):
        status, _, err = spoken(words.split())
        assert status == InvalidArgument.exit_status
        assert b"whole result.json, of SHA-256" in b" ".join(err.split())


@pytest.mark.full
def test_a_report_beside_a_passport_and_another_result(desk: Path) -> None:
    make_key(desk / "strange")
    before = state(desk)
    for place in (PRIVATE, "result.json"):  # not over its inputs
        assert run("sign", "result.json", "--key", PRIVATE, "-o", place)[0] == InvalidArgument.exit_status
    assert state(desk) == before
    beside, key = "result.json --passport camera.jws", f"--key {PUBLIC}"
    for more, message in (("", "not verified for this page"), (key, "Signature verified.")):
        assert spoken(f"report {beside} {more} -o out".split())[0] == 0
        page = Path("out/report.html").read_text("utf-8")
        assert all(words in page for words in ("A1B2", "2026-11-22 10:30:00+01:00", message))
    assert Path("out/result.json").read_bytes() == result_json()
    assert run("revoke", *read_public([PUBLIC]), "--key", PRIVATE, "-o", "revoked.jws")[0] == 0
    Path("other-result.json").write_bytes(result_json() + b" ")
    before = state(desk)
    for words, status, message in (
        (f"{beside} --key strange/{PUBLIC}", 10, ""), (f"{beside} {key} --revoked revoked.jws", 10, ""),
        (f"{beside} --revoked revoked.jws", 2, ""),  # nobody's signature was verified
        (f"other-{beside}", 10, "another result"), (f"other-{beside} {key}", 10, "another result"),
        (f"result.json {key}", 2, ""),
    ):  # fmt: skip
        found, _, err = spoken(f"report {words} -o out".split())
        assert (found, message.encode() in err) == (status, True), words
    assert state(desk) == before


def test_a_registry_takes_a_passport(desk: Path, said: Said) -> None:
    """And its whole result, and what `passport verify` printed: the same row, and nothing of it is lost."""
    passport, key = read(Path("camera.jws").read_bytes())[0], ("--key", PUBLIC)
    Path("printed.json").write_bytes(run("verify", "camera.jws", *key)[1])
    assert run("revoke", passport.id, "--key", PRIVATE, "-o", "revoked.jws")[0] == 0
    for more, status in (((), 2), ((*key, "--serial", "x"), 2), ((*key, "--revoked", "revoked.jws"), 10)):
        said("add", "phones", "camera.jws", *more, status=status)
    assert not Path("phones").exists()

    def row() -> dict[str, Any]:
        (stored,) = Registry("phones").query("SELECT * FROM rows")
        assert (stored["passport"], stored["serial"], stored["key"]) == (passport.id, "A1B2", passport.result_sha256)
        assert stored["captured"] == datetime(2026, 11, 22, 9, 30, tzinfo=UTC)
        return stored

    said("add", "phones", "camera.jws", *key)
    assert not row()["code_covariance"]
    said("add", "phones", "printed.json", status=2)  # a passport wants a key, in this form, too
    message = said("add", "phones", "result.json", "printed.json", *key)[1]
    assert "result.json: covariance added" in message
    assert "1 result changed in" in message
    assert list(row()["code_covariance"]) == pytest.approx(document().answer.code_covariance, abs=1e-6)


def test_two_hundred_megabytes(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In whatever place: the documented status, soon, since no more is read than may be there."""
    with open(desk / "huge", "wb") as file:
        file.write(b"{")
        file.truncate(200 * 10**6)
    (desk / "huge").chmod(0o600)
    for words, status in (
        (f"verify - --key {PUBLIC}", 10), (f"verify camera.jws --key {PUBLIC} --revoked huge", 10),
        ("verify camera.jws --key huge", 2), (f"sign huge --key {PRIVATE} -o x.jws", 2),
        (f"--passphrase huge sign result.json --key {PRIVATE} -o x.jws", 2),
    ):  # fmt: skip
        with open("huge", "rb") as file, io.TextIOWrapper(file) as text:
            monkeypatch.setattr("sys.stdin", text)
            assert cli.main(["passport", *words.split()]) == status, words
    with open("huge", "r+b") as file:
        file.write(b"A.")
    for words in (f"verify huge --key {PUBLIC}", "show huge"):
        assert cli.main(["passport", *words.split()]) == 10, words
    assert not (desk / "x.jws").exists()


@pytest.mark.full
def test_a_fleet_s_passports(desk: Path, said: Said) -> None:
    accepted, out = replace(document(), verdict=Verdict("accepted")), desk / "passports"
    for number, serial in enumerate(("A1", "A1", "B/2", "")):
        answer = replace(accepted.answer, evidence=float(number))
        Path(f"{number}.json").write_bytes(document_bytes(replace(accepted, answer=answer)))
        words = ("--serial", serial) if serial else ()
        said("add", "phones", f"{number}.json", *words, "--captured", f"2026-0{number + 1}-01")
    issue = ("issue", "phones", "--key", PRIVATE, "-o", "passports")
    assert run(*issue)[0] == 0
    assert sorted(path.name.partition("-")[0] for path in out.iterdir()) == ["A1", "B_2"]
    (a1,), (b2,) = out.glob("A1-*"), out.glob("B_2-*")
    trusted = read_public([PUBLIC])
    found = verify(a1.read_bytes(), trusted, result=Path("1.json").read_bytes())  # the newest
    assert (found.unit.serial, found.captured[:10]) == ("A1", "2026-02-01")
    rows = Registry("phones").query("SELECT serial, passport, passport_ends FROM rows WHERE passport <> ''")
    signed = (found, read(b2.read_bytes())[0])
    assert {(row["passport"], row["passport_ends"]) for row in rows} == {(each.id, each.ends) for each in signed}
    for more, message, count in (((), b"0 passports", 2), (("--renew", "400"), b"", 4)):
        status, _, err = run(*issue, *more)
        assert (status, message in err, len(list(out.iterdir()))) == (0, True, count)
    assert verify_registry(Registry("phones")).documents == 4
    Path("1.json").write_bytes(b"{}")
    Path("2.json").unlink()
    assert len(verify_registry(Registry("phones")).faults) == 1
    status, _, err = run(*issue, "--renew", "400")
    assert status == 0
    for words in (b"is not the result of its row", b"cannot be read"):
        assert words in b" ".join(err.split())
    assert run("revoke", *map(str, out.glob("A1-*")), "--key", PRIVATE, "-o", "revoked.jws")[0] == 0
    names = read_revoked(Path("revoked.jws").read_bytes(), trusted)
    assert len(names) == 2
    with pytest.raises(PassportInvalid, match="revoked"):
        verify(a1.read_bytes(), trusted, revoked=names)
    verify(b2.read_bytes(), trusted, revoked=names)


def test_colour_takes_a_passport(desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    passport = create_passport(document_bytes(calibrated()), PassportRequest(Unit(serial="A1")))
    Path("own.jws").write_bytes(sign(passport, read_private(PRIVATE)))
    Path("own.json").write_bytes(run("verify", "own.jws", "--key", PUBLIC)[1])

    def colour(name: str) -> tuple[int, str, str]:
        places = [np.min(calibrated().capture.shots[0].pose.patches[i], axis=0) + 4 for i in (3, 18)]
        region, white = (f"{x:.0f},{y:.0f},12,12" for x, y in places)
        words = ("--region", region, "--white-region", white, "--lamp", "D55")
        status, out, err = spoken(["colour", name, str(photos().shots[0].chart), *words])
        return status, out.decode(), " ".join(err.decode().split())

    status, out, message = colour("own.json")
    printed = json.loads(out)
    assert (status, printed["format"], "unit not checked: " in message) == (0, "camssf-colour/1", True)
    (region,) = printed["regions"]
    direct = standard_colour(passport.result, "D55", region["signal"])
    assert direct.lab[0] == pytest.approx(region["lab"], abs=0.3)  # without the reference
    status, _, message = colour("own.jws")
    assert (status, "own.jws is a passport, not a result" in message) == (InvalidArgument.exit_status, True)

    photo = raw.read_raw(photos().shots[0].chart)
    for serial, status in (("A1", 0), ("B2", UnitDiffers.exit_status)):
        of_unit = replace(photo, unit=replace(photo.unit, serial=serial))
        monkeypatch.setattr("camssf_colour.regions.read_raw", lambda path, taken=of_unit: taken)
        assert colour("own.json")[0] == status
