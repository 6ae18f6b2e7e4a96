"""A short part of `python -m tools.fuzz`: damaged files are read or refused by name; nothing else happens."""

import json
from collections import Counter
from pathlib import Path

import pytest

from camssf.documents.document import Document
from camssf.documents.forms import from_plain
from camssf.errors import InvalidArgument, UnsupportedRaw
from camssf_fleet.manifest import Manifest
from tools.fuzz import READERS, demo, fuzz, read, sound_files


@pytest.mark.parametrize("reader", READERS)
def test_sound_files_are_read(reader: str, tmp_path: Path) -> None:
    """What is damaged was worth damaging; of the forms of DNG a few are refused by name."""
    refused = []
    for suffix, data in sound_files(reader):
        path = tmp_path / f"file.{suffix}"
        path.write_bytes(data)
        try:
            READERS[reader](path)
        except UnsupportedRaw:
            refused.append(path)
    assert len(refused) <= (0.25 * len(sound_files(reader)) if reader == "dng" else 0)


@pytest.mark.requirement("R-HOSTILE")
@pytest.mark.full
@pytest.mark.parametrize("reader", [name for name in READERS if name != "dng"])
def test_damaged_files(reader: str, tmp_path: Path) -> None:
    outcomes = [read(reader, tmp_path, seed) for seed in range(60)]
    assert [(seed, words) for seed, (kind, words) in enumerate(outcomes) if kind == "finding"] == []
    assert {"invalid_argument"} <= {kind for kind, _ in outcomes}


@pytest.mark.requirement("R-HOSTILE")
@pytest.mark.full
def test_damaged_photos_in_a_process_of_their_own() -> None:
    outcomes = list(fuzz("dng", range(400)))
    assert [seed for seed, _, _ in outcomes] == list(range(400))
    assert [outcome for outcome in outcomes if outcome[1] == "finding"] == []
    kinds = Counter(kind for _, kind, _ in outcomes)
    assert kinds["read"] > 20
    assert kinds["unreadable_raw"] > 20


def test_what_the_long_run_found(tmp_path: Path) -> None:
    """50,000 files a reader showed these: a name that no file can have, numbers that fit no type."""
    manifest = tmp_path / "manifest.csv"
    manifest.write_text(f"name,photo,lamp\nA,a.dng,{'D' * 400}\n")
    assert Manifest(manifest).read_all()[0].lamps == ("D" * 400,)
    for path, value in ((("means", "saturation"), 2**5000), (("means", "chart", "count"), [[1e300] * 3] * 24)):
        document = json.loads(demo()["patches"])
        place = document["capture"]["shots"][0]
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        with pytest.raises(InvalidArgument):
            from_plain(document, Document, "patches.json", "")
