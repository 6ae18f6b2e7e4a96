"""The commands that set Kotlin's DNG reader beside LibRaw, its calibrator beside Python's, and time its colour, judge
rightly.

No JVM starts, no speed is judged.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.kernels import kotlin_calibrate, kotlin_colour, kotlin_decode
from golden.dngs import LONG, Dng
from tools import kotlin_variants


class Fake:
    """Stands in for the JVM."""

    def __init__(self, answer: int) -> None:
        self.answer = answer

    def ask(self, what: str, file: Path) -> tuple[float, int]:
        return 1.0, self.answer


def photo(folder: Path, **more: object) -> tuple[Path, np.ndarray]:
    samples = np.random.default_rng(0).integers(0, 4096, (40, 60), dtype=np.uint16)
    path = folder / "photo.dng"
    path.write_bytes(Dng(samples, bits=12, **more).encode())  # type: ignore[arg-type]
    return path, samples


def test_a_run_whose_samples_differ_from_libraw_s_ends(tmp_path: Path) -> None:
    path, samples = photo(tmp_path)
    total = int(samples.sum())
    found = kotlin_decode.measure(Fake(total), path, 3)  # type: ignore[arg-type]
    assert found["kotlin_seconds"] == 1.0
    assert found["ratio"] == pytest.approx(1.0 / found["libraw_seconds"], rel=0.9)
    with pytest.raises(SystemExit, match="differ"):
        kotlin_decode.measure(Fake(total + 1), path, 3)  # type: ignore[arg-type]


def test_without_a_build_the_command_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pom.xml").write_text("<kotlin.version>0</kotlin.version>")
    monkeypatch.setattr(kotlin_decode, "BINDINGS", tmp_path)
    with pytest.raises(kotlin_decode.Unavailable, match="mvn"):
        kotlin_decode.class_path()


@pytest.mark.full
@pytest.mark.parametrize("place", ["first", "chain", "sub", "nested"])
def test_both_judges_give_the_active_area_s_samples(tmp_path: Path, place: str) -> None:
    path, samples = photo(tmp_path, place=place, tags={50829: (LONG, [4, 6, 38, 60])})
    expected = hashlib.sha256(samples[4:38, 6:60].astype("<u2").tobytes()).hexdigest()
    assert kotlin_variants.judge(path) == {"libraw": expected, "tifffile": expected}


def test_the_calibrator_s_benchmark_compares_and_says_what_it_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    curves = {colour: [0.5, 1.0] for colour in ("red", "green", "blue")}
    other = curves | {"green": [0.5, 0.75]}
    assert kotlin_calibrate.distance({"ssf": curves}, {"ssf": other}) == 0.25
    monkeypatch.setattr(kotlin_calibrate, "BINDINGS", tmp_path)
    with pytest.raises(kotlin_calibrate.Unavailable, match="mvn"):
        kotlin_calibrate.class_path()


def test_the_calibrator_s_benchmark_refuses_other_curves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    curves = {"ssf": {colour: [0.5, 1.0] for colour in ("red", "green", "blue")}}
    (tmp_path / "kotlin.json").write_text(json.dumps(curves | {"ssf": curves["ssf"] | {"red": [0.6, 1.0]}}))
    monkeypatch.setattr(kotlin_calibrate, "python", lambda shot: (1.0, curves))
    monkeypatch.setattr(kotlin_calibrate, "words", lambda shot, out: [])

    class Fake:
        def calibrate(self, words: list[str]) -> tuple[float, float]:
            return 0.5, 0.1

    with pytest.raises(SystemExit, match="differ"):
        kotlin_calibrate.measure(Fake(), None, 2, tmp_path)  # type: ignore[arg-type]
    (tmp_path / "kotlin.json").write_text(json.dumps(curves))
    assert kotlin_calibrate.measure(Fake(), None, 2, tmp_path)["ratio"] == 0.5  # type: ignore[arg-type]


def test_the_colour_s_benchmark_reads_its_times_and_judges_reading_and_lab(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    java = tmp_path / "java"
    java.write_text("#!/bin/sh\necho 80 0.5 0.25 4.0 10000\n")
    java.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(kotlin_colour, "class_path", lambda: "")
    found = kotlin_colour.measure("colour/named", 3)
    assert found == {"make": 80.0, "read": 0.5, "xyz": 0.25, "lab": 4.0}
    assert kotlin_colour.holds({"named": found})
    assert not kotlin_colour.holds({"named": found, "auto": found | {"read": 1.0}})
    java.write_text("#!/bin/sh\necho 80 0.5 0.25 4.0 9999\n")
    with pytest.raises(kotlin_colour.Unavailable, match="colour/named"):
        kotlin_colour.measure("colour/named", 3)
