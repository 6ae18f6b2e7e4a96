"""Passports of a fleet: issued once a unit, renewed, revoked by file; a photo of another unit is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camssf import cli
from camssf.documents.document import document_bytes
from camssf.errors import InvalidArgument, PassportInvalid, UnitDiffers
from camssf.photo.read import raw
from camssf.photo.read.unit import Unit
from camssf.verdict.reasons import Verdict
from camssf_colour import standard_colour
from tests.support.captures import calibrated, photos
from tests.support.documents import document

pytest.importorskip("cryptography", reason="cryptography is not here")

from camssf_fleet.passport.document import Passport, PassportRequest, create_passport, read, sign, verify
from camssf_fleet.passport.keys import PRIVATE, PUBLIC, make_key, read_private, read_public
from camssf_fleet.passport.revocations import read_revoked
from camssf_fleet.registry import Registry
from camssf_fleet.verification import verify as verify_registry


def run(*words: object) -> int:
    return cli.main(list(map(str, words)))


# A fleet's


def test_a_fleet_s_passports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make_key(tmp_path)
    folder, out, key = tmp_path / "phones", tmp_path / "passports", ("--key", tmp_path / PRIVATE)
    accepted = replace(document(), verdict=Verdict("accepted"))
    for number, serial in enumerate(("A1", "A1", "B/2", "")):
        file = tmp_path / f"{number}.json"
        answer = replace(accepted.answer, evidence=float(number))
        file.write_bytes(document_bytes(replace(accepted, answer=answer)))
        words = ("--serial", serial) if serial else ()
        assert run("registry", "add", folder, file, *words, "--captured", f"2026-0{number + 1}-01") == 0
    issue = ("passport", "issue", folder, *key, "-o", out)
    assert run(*issue) == 0
    assert sorted(path.name.partition("-")[0] for path in out.iterdir()) == ["A1", "B_2"]
    (a1,), (b2,) = out.glob("A1-*"), out.glob("B_2-*")
    trusted = read_public([tmp_path / PUBLIC])
    found = verify(a1.read_bytes(), trusted, result=(tmp_path / "1.json").read_bytes())  # the newest
    assert (found.unit.serial, found.captured[:10]) == ("A1", "2026-02-01")
    rows = Registry(folder).query("SELECT serial, passport, passport_ends FROM rows WHERE passport <> ''")
    assert {(row["passport"], row["passport_ends"]) for row in rows} == {
        (each.id, each.ends) for each in (found, read(b2.read_bytes())[0])
    }
    capsys.readouterr()
    assert run(*issue) == 0
    assert "0 passports" in capsys.readouterr().err
    assert len(list(out.iterdir())) == 2
    assert run(*issue, "--renew", "400") == 0
    assert len(list(out.iterdir())) == 4
    assert verify_registry(Registry(folder)).documents == 4
    (tmp_path / "1.json").write_bytes(b"{}")
    (tmp_path / "2.json").unlink()
    assert len(verify_registry(Registry(folder)).faults) == 1
    assert run(*issue, "--renew", "400") == 0
    message = " ".join(capsys.readouterr().err.split())
    assert "is not the result of its row" in message
    assert "cannot be read" in message
    revoked = tmp_path / "revoked.jws"
    assert run("passport", "revoke", *out.glob("A1-*"), *key, "-o", revoked) == 0
    names = read_revoked(revoked.read_bytes(), trusted)
    assert len(names) == 2
    with pytest.raises(PassportInvalid, match="revoked"):
        verify(a1.read_bytes(), trusted, revoked=names)
    verify(b2.read_bytes(), trusted, revoked=names)


# One unit's


def _passport() -> Passport:
    return create_passport(document_bytes(calibrated()), PassportRequest(Unit(serial="A1")))


def test_colour_takes_a_passport(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_key(tmp_path)
    passport = _passport()
    (tmp_path / "own.jws").write_bytes(sign(passport, read_private(tmp_path / PRIVATE)))
    assert run("passport", "verify", tmp_path / "own.jws", "--key", tmp_path / PUBLIC) == 0
    (tmp_path / "own.json").write_text(capsys.readouterr().out, "utf-8")

    def colour(name: str) -> tuple[int, str, str]:
        places = [np.min(calibrated().capture.shots[0].pose.patches[i], axis=0) + 4 for i in (3, 18)]
        here, white = (f"{x:.0f},{y:.0f},12,12" for x, y in places)
        words = ("--region", here, "--white-region", white, "--lamp", "D55")
        status = run("colour", tmp_path / name, photos().shots[0].chart, *words)
        out, err = capsys.readouterr()
        return status, out, " ".join(err.split())

    status, out, message = colour("own.json")
    assert (status, json.loads(out)["format"]) == (0, "camssf-colour/1")
    assert "unit not checked: " in message
    (signals,) = (each["signal"] for each in json.loads(out)["regions"])
    found = standard_colour(passport.result, "D55", signals)
    assert found.lab[0] == pytest.approx(json.loads(out)["regions"][0]["lab"], abs=0.3)  # without the reference
    status, _, message = colour("own.jws")
    assert (status, "own.jws is a passport, not a result" in message) == (InvalidArgument.exit_status, True)

    def of_serial(serial: str) -> int:
        with monkeypatch.context() as patched:
            patched.setattr("camssf_colour.regions.read_raw", partial(_with_serial, raw.read_raw, serial))
            return colour("own.json")[0]

    assert (of_serial("A1"), of_serial("B2")) == (0, UnitDiffers.exit_status)


def _with_serial(read_raw: Callable[[str], Any], serial: str, path: str) -> Any:
    mosaic = read_raw(path)
    return replace(mosaic, unit=replace(mosaic.unit, serial=serial))
