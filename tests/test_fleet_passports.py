"""Passports of a fleet: issued once a unit, renewed, revoked by file; a photo of another unit is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from captures import calibrated, photos
from documents import document

from camssf import cli
from camssf.colour import standard_colour
from camssf.documents.result_json import document_bytes
from camssf.errors import InvalidArgument, PassportInvalid, UnitDiffers
from camssf.photo.read import raw
from camssf.photo.read.unit import Unit

pytest.importorskip("cryptography", reason="cryptography is not here")

from camssf.documents.keys import PRIVATE, PUBLIC, make_key, read_private, read_public
from camssf.documents.passport import Passport, PassportRequest, create_passport, read, sign, verify
from camssf.documents.revocations import read_revoked


def run(*words: object) -> int:
    return cli.main(list(map(str, words)))


# A fleet's


def test_a_fleet_s_passports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("duckdb", reason="duckdb is not here")
    pytest.importorskip("deltalake", reason="deltalake is not here")
    from camssf.fleet.registry import Registry
    from camssf.fleet.verify import verify as verify_registry

    make_key(tmp_path)
    folder, out, key = tmp_path / "phones", tmp_path / "passports", ("--key", tmp_path / PRIVATE)
    accepted = document() | {"verdict": document()["verdict"] | {"status": "accepted", "reasons": []}}
    for number, serial in enumerate(("A1", "A1", "B/2", "")):
        file = tmp_path / f"{number}.json"
        file.write_bytes(document_bytes(accepted | {"evidence": float(number)}))
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
    told = " ".join(capsys.readouterr().err.split())
    assert "is not the result of its row" in told
    assert "cannot be read" in told
    revoked = tmp_path / "revoked.jws"
    assert run("passport", "revoke", *out.glob("A1-*"), *key, "-o", revoked) == 0
    names = read_revoked(revoked.read_bytes(), trusted)
    assert len(names) == 2
    with pytest.raises(PassportInvalid, match="revoked"):
        verify(a1.read_bytes(), trusted, revoked=names)
    verify(b2.read_bytes(), trusted, revoked=names)


# One unit's


def test_a_passport_knows_its_unit() -> None:
    passport = replace(_passport(), unit=Unit("Maker", "Model", "2", "A1", "24 mm", 24.7, 1.8))
    passport.check_photo(Unit("Maker", "Model", "2", "A1", "24 mm", 50.0, 8.0), "a.dng")
    passport.check_photo(Unit(), "a.dng")
    for name, other in (("serial", "B2"), ("model", "Other"), ("camera_id", "0"), ("lens", "35 mm")):
        with pytest.raises(UnitDiffers, match=f"a.dng was taken by another unit .*: {name} '{other}' against"):
            passport.check_photo(replace(passport.unit, **{name: other}), "a.dng")


def _passport() -> Passport:
    return create_passport(document_bytes(calibrated().document()), PassportRequest(Unit(serial="A1")))


def test_colour_takes_a_passport(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_key(tmp_path)
    passport, signer = _passport(), read_private(tmp_path / PRIVATE)
    old = replace(passport, begins=datetime(2020, 1, 1, tzinfo=UTC), ends=datetime(2020, 1, 2, tzinfo=UTC))
    for name, each in (("own", passport), ("old", replace(old, issued=old.begins - timedelta(days=1)))):
        (tmp_path / f"{name}.jws").write_bytes(sign(each, signer))

    def colour(name: str, *more: object) -> tuple[int, str, str]:
        places = [np.min(calibrated().document()["shots"][0]["pose"]["patches"][i], axis=0) + 4 for i in (3, 18)]
        here, white = (f"{x:.0f},{y:.0f},12,12" for x, y in places)
        words = ("--region", here, "--white-region", white, "--lamp", "D55", *more)
        status = run("colour", tmp_path / name, photos().shots[0].chart, *words)
        out, err = capsys.readouterr()
        return status, out, " ".join(err.split())

    key = ("--key", tmp_path / PUBLIC)
    status, out, told = colour("own.jws", *key)
    assert (status, json.loads(out)["format"]) == (0, "camssf-colour/1")
    assert "unit not checked: " in told
    (signals,) = (each["signal"] for each in json.loads(out)["regions"])
    found = standard_colour(passport, "D55", signals)
    assert found.lab[0] == pytest.approx(json.loads(out)["regions"][0]["lab"], abs=0.3)  # without the reference
    status, _, told = colour("own.jws")
    assert (status, "own.jws is a passport, not a result" in told) == (InvalidArgument.exit_status, True)
    assert colour("old.jws", *key)[0] == PassportInvalid.exit_status

    def of_serial(serial: str) -> int:
        with monkeypatch.context() as patched:
            patched.setattr("camssf.colour.regions.read_raw", partial(_with_serial, raw.read_raw, serial))
            return colour("own.jws", *key)[0]

    assert (of_serial("A1"), of_serial("B2")) == (0, UnitDiffers.exit_status)


def _with_serial(read_raw: Callable[[str], Any], serial: str, path: str) -> Any:
    mosaic = read_raw(path)
    return replace(mosaic, unit=replace(mosaic.unit, serial=serial))
