"""Stores what users get: `python -m tools.freeze FOLDER`, before a change that must change nothing, and after it.

Then `git diff --no-index BEFORE AFTER` shows each difference. A folder holds documents, exit statuses and pages of
some forty simulated captures with fixed seeds, every export, a colour and a spectrum of one result, the error codes,
and the hashes of the models and of the golden manifest. Numbers have ten digits, so that rounding is no difference.
Results come from the command line: names inside the package may change.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.faults import apply_fault
from camssf.spectra.cameras import DEMO_PHONE
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.frames import simulate
from camssf_lab.simulation.scene import Scene
from tools.chart_colours import semi_gloss

ROOT = Path(__file__).parents[1]
CAMERA = "Canon EOS 5D Mark II"
ONE, TWO = "chart.dng --white white.dng --dark dark.dng", "chart-D55.dng chart-A.dng"
TWO_FRAMES = " --white white-D55.dng --white white-A.dng --dark dark-D55.dng --dark dark-A.dng"
APPLE = {"camera": DEMO_PHONE, "sensor": {"make": "Apple"}}
FAULTS = (
    "black", "clipped", "clipped-channel", "covered", "dark-leak", "defocus", "faded", "glare", "motion", "shading",
    "shadow", "specular", "tone-mapped", "two-lamps", "underexposed", "upside-down", "white-lamp", "wrong-lamp",
)  # fmt: skip
CAPTURES: dict[str, tuple[str, dict[str, Any]]] = {
    "accepted": (f"{ONE} --lamp D55", {}),
    "reference": (f"{ONE} --lamp D55 --engine reference", {"seed": 1}),
    "gaussian": (f"{ONE} --lamp D55 --basis gaussian --fit 7-18", {"sensor": {"noise": False}}),
    "gaussian-signed": (f"{ONE} --lamp D55 --basis gaussian --signed --l2 0.01", {}),
    "l1-only": (f"{ONE} --lamp D55 --l2 0 --gamma 1.4 --basis cameras", {}),
    "bulb-turned": (
        f"{ONE} --lamp bulb", {"lamps": ["A"], "seed": 2, "scene": {"rotation": 180.0}, "sensor": {"cfa": "GBRG"}}
    ),
    "two-shots": (f"{TWO} --lamp D55 --lamp A{TWO_FRAMES}", {"lamps": ["D55", "A"], "seed": 3}),
    "two-shots-gains": (
        f"{TWO} --lamp D55 --lamp A", {"lamps": ["D55", "A"], "seed": 9, "scene": {"vignetting": 0.3}}
    ),
    "white-led": (f"{ONE} --lamp white-led", {"lamps": ["LED-B3"], "camera": DEMO_PHONE, "seed": 10}),
    "fluorescent": (f"{ONE} --lamp fluorescent", {"lamps": ["FL2"], "camera": DEMO_PHONE, "seed": 11}),
    "kelvin": (f"{ONE} --lamp 2856K --lamp-tolerance 100K", {"lamps": ["A"], "seed": 12}),
    "unnamed": (ONE, APPLE | {"seed": 4}),
    "unnamed-led": (ONE, APPLE | {"lamps": ["LED-B3"], "seed": 13}),
    "unnamed-bulb-uneven": (
        "chart.dng", APPLE | {"lamps": ["A"], "seed": 14, "scene": {"vignetting": 0.3, "tilt": 10.0}}
    ),
    "unnamed-two": (TWO, APPLE | {"lamps": ["D55", "A"], "seed": 15}),
    "phone-named": (f"{ONE} --lamp D65", APPLE | {"lamps": ["D65"], "seed": 16}),
    "unnamed-camera": (ONE, {"seed": 5}),
    "semi-gloss": (
        f"{ONE} --lamp D55 --chart sg140:sg.csv --corners corners.json",
        {"seed": 6, "scene": {"size": (1200, 900)}, "chart": "sg140:sg.csv"},
    ),
    "doubtful": ("chart.dng --lamp D55 --white white.dng", {"seed": 8, "scene": {"glare": 0.03}}),
    "no-white": ("chart.dng --lamp D55 --dark dark.dng", {"seed": 7, "scene": {"vignetting": 0.15}}),
    "truth": (f"{ONE} --lamp D55 --truth truth.csv", {"seed": 17}),
    "twelve-patches": (f"{ONE} --lamp D65 --fit 7-18", {"lamps": ["D65"], "seed": 18}),
    "no-chart": ("white.dng --lamp D55", {}),
    **{f"fault-{name}": (f"{ONE} --lamp D55", {"seed": 20, "fault": name}) for name in FAULTS},
}  # fmt: skip
"""By name: photos and options of `calibrate`, and what is simulated."""


def photograph(
    *, camera: str = CAMERA, lamps: Sequence[str] = ("D55",), chart: str = "classic24", seed: int = 0,
    scene: dict[str, Any] | None = None, sensor: dict[str, Any] | None = None, fault: str = "",
) -> None:  # fmt: skip
    """Write a capture's photos into the current folder, and the table of a semi-gloss chart where one is named."""
    if ":" in chart:
        table = semi_gloss()
        head = ["wavelength_nm", *table.patches]
        rows = [[table.wavelengths[i], *table.values[:, i]] for i in range(0, table.wavelengths.size, 20)]
        Path("sg.csv").write_text("\n".join(",".join(map(str, row)) for row in (head, *rows)) + "\n", "utf-8")
    view: dict[str, Any] = {"size": (600, 450), "fill": 0.85} | (scene or {})
    change = apply_fault(fault, 2) if fault else None
    simulate(
        camera,
        list(lamps),
        Path(),
        chart=chart,
        scene=Scene(**view),
        sensor=Sensor(**sensor or {}),
        seed=seed,
        change=change,
    )


def camssf(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command line with one BLAS thread, wide lines, no colours and a fixed time in every export."""
    fixed = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"}
    return subprocess.run(
        [sys.executable, "-m", "camssf", *words], cwd=folder, env=os.environ | fixed | {"SOURCE_DATE_EPOCH": "0"},
        capture_output=True, text=True,
    )  # fmt: skip


def rounded(document: str) -> str:
    """A JSON document with ten digits a number, and none below 1e-15: a duality gap is rounding noise."""

    def number(text: str) -> float:
        return float(f"{float(text):.10g}") if abs(float(text)) >= 1e-15 else 0.0

    return json.dumps(json.loads(document, parse_float=number), indent=1, ensure_ascii=False) + "\n"


def keep(folder: Path) -> None:
    """Write everything into a folder."""
    for name, (words, simulated) in CAPTURES.items():
        place = folder / name
        place.mkdir(parents=True)
        with tempfile.TemporaryDirectory() as aside, contextlib.chdir(aside):
            photograph(**simulated)
            # Some faults are a frame that is missing.
            present = re.sub(r" --\w+ (\S+\.dng)", lambda frame: frame[0] * Path(frame[1]).exists(), words)
            run = camssf(Path(), "calibrate", *present.split(), "-o", "out")
            (place / "status.txt").write_text(f"{run.returncode}\n{run.stderr}", "utf-8")
            (place / "result.json").write_text(rounded(Path("out/result.json").read_text("utf-8")), "utf-8")
            shutil.copy("out/report.html", place)
            if name == "accepted":
                derive(Path("out/result.json"), folder)
    listed = camssf(folder, "explain").stdout
    codes = re.findall(r"^\s*([a-z]+(?:_[a-z]+)*)\b", listed, re.MULTILINE)
    (folder / "errors.txt").write_text(listed + "".join(camssf(folder, "explain", code).stdout for code in codes))
    data = [*(ROOT / "reference" / "camssf" / "data").glob("*.onnx"), ROOT / "golden" / "manifest.json"]
    sums = [f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n" for path in sorted(data)]
    (folder / "hashes.txt").write_text("".join(sums), "utf-8")


def derive(result: Path, folder: Path) -> None:
    """Write the colour and the spectrum of a region, and every export that `export --help` lists."""
    for command in ("colour", "spectrum"):
        regions = ("--lamp", "D55", "--region", "100,100,20,20", "--white-region", "300,220,20,20")
        (folder / f"{command}.json").write_text(
            rounded(camssf(Path(), command, str(result), "chart.dng", *regions).stdout), "utf-8"
        )
    found = re.search(r"--to FORMAT One of ([\w, -]+)\.", " ".join(camssf(Path(), "export", "--help").stdout.split()))
    assert found is not None, "`camssf export --help` names no formats in the words that are looked for"
    for name in found[1].split(", "):
        out = folder / f"export.{name}"
        camssf(Path(), "export", str(result), "--to", name, "--licence", "CC0-1.0", "-o", str(out)).check_returncode()


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tools.freeze", description=__doc__)
    parser.add_argument("folder", type=Path, help="new, and outside of the repository")
    keep(parser.parse_args().folder.resolve())


if __name__ == "__main__":
    main()
