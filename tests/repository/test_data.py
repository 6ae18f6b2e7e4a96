"""Every file of data/ is the one that data/README.md describes, and its licence is in NOTICE."""

import hashlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "data"

pytestmark = pytest.mark.repository


def table() -> dict[str, list[str]]:
    """The rows of data/README.md: file → what, origin, licence, SHA-256."""
    lines = (DATA / "README.md").read_text("utf-8").splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if re.match(r"\| \w+/", line)]
    return {row[0]: row[1:] for row in rows}


def test_every_file_is_described_and_none_has_changed() -> None:
    found = {
        path.relative_to(DATA).as_posix(): f"`{hashlib.sha256(path.read_bytes()).hexdigest()}`"
        for path in DATA.rglob("*")
        if path.is_file() and path != DATA / "README.md"
    }
    assert found == {name: row[3] for name, row in table().items()}


def test_every_licence_allows_it_and_is_in_the_notice() -> None:
    notice = (ROOT / "NOTICE").read_text("utf-8")
    full = {
        "Apache-2.0": "Apache License, Version 2.0",
        "MIT": "MIT licence",
        "BSD-3-Clause": "BSD-3-Clause licence",
        "BSL-1.0": "Boost Software License 1.0\n----",
    }
    for name, (_, origin, licence, _) in table().items():
        assert origin, name
        assert full[licence] in notice, name


def test_what_may_not_ship_is_not_here() -> None:
    assert not list(ROOT.rglob("phones.csv"))
    assert not list(ROOT.rglob("foreign.csv"))
