"""Stores what users get and compares it later: `python -m tools.freeze write FOLDER`, then `... compare FOLDER`.

It stores the photos of some forty simulated captures with fixed seeds, their documents and pages (four with
screenshots if Chromium is installed), every export, a colour and a spectrum of one result, the error codes, and the
hashes of the models and of the golden manifest. `compare` makes everything again from the stored photos, prints every
difference with its path, and exits with 1 if there is one. Results come from the command line, so names inside the
package may change.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import hashlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from difflib import unified_diff
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

Json: TypeAlias = Any

ROOT = Path(__file__).parents[1]
RELATIVE, NOUGHT = 1e-12, 1e-18
"""Tolerances of numbers: relative to the largest in their list, and absolute (duality gaps are rounding noise)."""
PIXELS = 1e-3
"""Fraction of a picture's pixels that may differ."""
AT_ONCE = 2
PHOTOS, KEPT = "photos", "kept"
"""Folders of what was photographed and of what was made of it."""
CAMERA = "Canon EOS 5D Mark II"
"""Name in the bundled table."""
PHONE = "phone.csv"
"""A phone's curves, made by `write_phone`."""
WHITE_DARK = ("--white", "white.dng", "--dark", "dark.dng")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@dataclass(frozen=True)
class Capture:
    """One capture: what is simulated, and how it is calibrated.

    Attributes:
        call: photos and options of `calibrate`; files in the scene's folder.
        lamps: of the photos.
        camera: a bundled camera, or PHONE.
        seed: of the noise.
        scene: fields of the simulated `Scene`.
        sensor: fields of the simulated `Sensor`.
        chart: name, or name:table.
        fault: name and severity of a simulated fault; None without.
    """

    call: tuple[str, ...]
    lamps: tuple[str, ...] = ("D55",)
    camera: str = CAMERA
    seed: int = 0
    scene: Json = field(default_factory=dict)
    sensor: Json = field(default_factory=dict)
    chart: str = "classic24"
    fault: tuple[str, int] | None = None


def _named(lamp: str, *words: str, **scene: Any) -> Capture:
    return Capture(("chart.dng", "--lamp", lamp, *WHITE_DARK, *words), (lamp,), **scene)


def _phone(lamp: str, *words: str, seed: int, **scene: Any) -> Capture:
    call = ("chart.dng", *words)
    return Capture(call, (lamp,), PHONE, seed, sensor={"make": "Apple"}, **scene)


TWO = ("chart-D55.dng", "chart-A.dng", "--lamp", "D55", "--lamp", "A")
TWO_WHITES = ("--white", "white-D55.dng", "--white", "white-A.dng", "--dark", "dark-D55.dng", "--dark", "dark-A.dng")
FAULTS = (
    "black", "clipped", "clipped-channel", "covered", "dark-leak", "defocus", "faded", "glare", "motion", "shading",
    "shadow", "specular", "tone-mapped", "two-lamps", "underexposed", "upside-down", "white-lamp", "wrong-lamp",
)  # fmt: skip
CAPTURES = {
    "accepted": _named("D55"),
    "reference": _named("D55", "--engine", "reference", seed=1),
    "gaussian": _named("D55", "--basis", "gaussian", "--fit", "7-18", sensor={"noise": False}),
    "gaussian-signed": _named("D55", "--basis", "gaussian", "--signed", "--l2", "0.01"),
    "l1-only": _named("D55", "--l2", "0", "--gamma", "1.4", "--basis", "cameras"),
    "bulb-turned": Capture(
        ("chart.dng", "--lamp", "bulb", *WHITE_DARK), ("A",), seed=2, scene={"rotation": 180.0},
        sensor={"cfa": "GBRG"},
    ),
    "two-shots": Capture((*TWO, *TWO_WHITES), ("D55", "A"), seed=3),
    "two-shots-gains": Capture(TWO, ("D55", "A"), seed=9, scene={"vignetting": 0.3}),
    "white-led": Capture(("chart.dng", "--lamp", "white-led", *WHITE_DARK), ("LED-B3",), PHONE, 10),
    "fluorescent": Capture(("chart.dng", "--lamp", "fluorescent", *WHITE_DARK), ("FL2",), PHONE, 11),
    "kelvin": Capture(("chart.dng", "--lamp", "2856K", "--lamp-tolerance", "100K", *WHITE_DARK), ("A",), seed=12),
    "unnamed": _phone("D55", *WHITE_DARK, seed=4),
    "unnamed-led": _phone("LED-B3", *WHITE_DARK, seed=13),
    "unnamed-bulb-uneven": _phone("A", seed=14, scene={"vignetting": 0.3, "tilt": 10.0}),
    "unnamed-two": Capture(
        ("chart-D55.dng", "chart-A.dng"), ("D55", "A"), PHONE, 15, sensor={"make": "Apple"}
    ),
    "phone-named": _phone("D65", "--lamp", "D65", *WHITE_DARK, seed=16),
    "unnamed-camera": Capture(("chart.dng", *WHITE_DARK), seed=5),
    "semi-gloss": Capture(
        ("chart.dng", "--lamp", "D55", *WHITE_DARK, "--chart", "sg140:sg.csv", "--corners", "corners.json"),
        seed=6, scene={"size": (1200, 900)}, chart="sg140:sg.csv",
    ),
    "doubtful": Capture(("chart.dng", "--lamp", "D55", "--white", "white.dng"), seed=8, scene={"glare": 0.03}),
    "no-white": Capture(
        ("chart.dng", "--lamp", "D55", "--dark", "dark.dng"), seed=7, scene={"vignetting": 0.15}
    ),
    "truth": _named("D55", "--truth", "truth.csv", seed=17),
    "twelve-patches": _named("D65", "--fit", "7-18", seed=18),
    "no-chart": Capture(("white.dng", "--lamp", "D55")),
    **{f"fault-{name}": Capture(("chart.dng", "--lamp", "D55"), seed=20, fault=(name, 2)) for name in FAULTS},
}  # fmt: skip
PAGES = ("accepted", "two-shots", "unnamed", "fault-clipped")
"""Captures whose pages are photographed."""
EXPORTED = "accepted"
REGION = ("--lamp", "D55", "--region", "100,100,20,20", "--white-region", "300,220,20,20")


# What is made


def photograph(folder: Path) -> None:
    """Write the photos of all captures, and the tables that they need."""
    from benchmarks.faults import apply_fault
    from camssf_lab.simulation.camera import Sensor
    from camssf_lab.simulation.frames import simulate
    from camssf_lab.simulation.scene import Scene

    for name, capture in CAPTURES.items():
        place = folder / name
        place.mkdir(parents=True)
        write_phone(place / PHONE)
        if capture.chart != "classic24":
            write_semi_gloss(place / "sg.csv")
        with contextlib.chdir(place):
            simulate(
                capture.camera,
                list(capture.lamps),
                Path(),
                chart=capture.chart,
                scene=Scene(**{"size": (600, 450), "fill": 0.85} | capture.scene),
                sensor=Sensor(**capture.sensor),
                seed=capture.seed,
                change=None if capture.fault is None else apply_fault(*capture.fault),
            )


def make(photos: Path, folder: Path) -> None:
    """Write everything into an empty folder, from the photos of all captures."""
    with tempfile.TemporaryDirectory() as place, ThreadPoolExecutor(AT_ONCE) as pool:
        work = Path(place)
        shutil.copytree(photos, work, dirs_exist_ok=True)
        jobs = [pool.submit(calibrate, work / name, name, folder) for name in CAPTURES]
        jobs.append(pool.submit(error_codes, folder))
        for job in jobs:
            job.result()
        exports(work / EXPORTED / "out" / "result.json", folder / "exports")
        for command in ("colour", "spectrum"):
            done = camssf(work / EXPORTED, command, "out/result.json", "chart.dng", *REGION, check=False)
            put(folder / "results" / f"{command}.json", done.stdout)
    data = [*(ROOT / "reference" / "camssf" / "data").glob("*.onnx"), ROOT / "golden" / "manifest.json"]
    sums = sorted(f"{hashlib.sha256(path.read_bytes()).hexdigest()} {path.name}\n" for path in data)
    put(folder / "hashes.txt", "".join(sums))


def calibrate(work: Path, name: str, folder: Path) -> None:
    """Calibrate a capture in its folder; store the document, the exit status and the page."""
    call = CAPTURES[name].call
    if CAPTURES[name].fault is not None:  # some faults are a frame that is missing
        frames = [role for role in ("white", "dark") if (work / f"{role}.dng").exists()]
        call += tuple(word for role in frames for word in (f"--{role}", f"{role}.dng"))
    run = camssf(work, "calibrate", *call, "-o", "out", check=False)
    put(folder / "results" / f"{name}.status", f"{run.returncode}\n")
    document = work / "out" / "result.json"
    if not document.exists():
        raise SystemExit(f"{name}: calibrate wrote no result:\n{run.stderr}")
    put(folder / "results" / f"{name}.json", document.read_text("utf-8"))
    page = work / "out" / "report.html"
    put(folder / "pages" / f"{name}.txt", text_of_page(page.read_text("utf-8")))
    if name in PAGES:
        picture_of(page, folder / "pages" / f"{name}.png", work / "profile")


def exports(result: Path, folder: Path) -> None:
    """Export one result in every format that `export --help` lists."""
    words = " ".join(camssf(result.parent, "export", "--help").stdout.split())
    found = re.search(r"--to FORMAT One of ([\w, -]+)\.", words)
    if found is None:
        raise SystemExit("`camssf export --help` names no formats in the words that are looked for.")
    for name in found[1].split(", "):
        out = result.parent / f"exported.{name}"
        camssf(result.parent, "export", result.name, "--to", name, "--licence", "CC0-1.0", "-o", out.name)
        folder.mkdir(exist_ok=True)
        shutil.copy(out, folder / name)


def error_codes(folder: Path) -> None:
    """Store the list of error codes and the explanation of each."""
    listed = camssf(folder, "explain").stdout
    put(folder / "errors" / "list.txt", listed)
    for code in re.findall(r"^\s*([a-z]+(?:_[a-z]+)*)\b", listed, re.MULTILINE):
        put(folder / "errors" / f"{code}.txt", camssf(folder, "explain", code).stdout)


def camssf(folder: Path, *words: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run the command line with one BLAS thread, wide lines, no colours and a fixed time in every export."""
    one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    environment = {**os.environ, **one, "COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb", "SOURCE_DATE_EPOCH": "0"}
    run = subprocess.run(
        [sys.executable, "-m", "camssf", *words], cwd=folder, env=environment, capture_output=True, text=True
    )
    if check and run.returncode:
        raise SystemExit(f"camssf {' '.join(words)} ended with {run.returncode}:\n{run.stderr}")
    return run


def put(path: Path, text: str) -> None:
    """Write a text file, and create its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, "utf-8")


def write_phone(path: Path) -> None:
    """Write curves similar to a phone's, as sums of Gaussians."""
    nm = np.arange(380, 721, 5)

    def bell(centre: float, width: float) -> Any:
        return np.exp(-0.5 * ((nm - centre) / width) ** 2)

    red = bell(600, 32) + 0.12 * bell(525, 35) + 0.04 * bell(450, 25)
    green = bell(530, 36) + 0.10 * bell(600, 30) + 0.06 * bell(460, 25)
    blue = bell(460, 27) + 0.12 * bell(510, 25) + 0.02 * bell(600, 30)
    write_table(path, ["wavelength_nm", "red", "green", "blue"], np.column_stack([nm, red, green, blue]))


def write_semi_gloss(path: Path) -> None:
    """Write a chart of 14 by 10 patches with smooth spectra: grey border, coloured interior, one white patch."""
    nm, draw = np.arange(380, 721, 10), np.random.default_rng(140)
    rise = 1 / (1 + np.exp((nm[:, None] - np.array([490, 585])) / 15))
    bands = np.stack([rise[:, 0], rise[:, 1] - rise[:, 0], 1 - rise[:, 1]])
    names: list[str] = []
    columns = []
    for row in range(1, 11):
        for letter in "ABCDEFGHIJKLMN":
            border = letter in "AN" or row in (1, 10)
            grey = (0.9, 0.2, 0.04)[(len(names) + row) % 3]
            weights = np.full(3, grey) if border else draw.uniform(0.04, 0.8, 3)
            names.append(f"{letter}{row}")
            columns.append((np.full(3, 0.9) if names[-1] == "E5" else weights) @ bands)
    write_table(path, ["wavelength_nm", *names], np.column_stack([nm, *columns]))


def write_table(path: Path, head: Sequence[str], rows: Any) -> None:
    """Write a CSV."""
    with open(path, "w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        writer.writerows([[f"{value:.8g}" for value in row] for row in rows])


# Pages


class _Text(HTMLParser):
    """Collects the texts of a page, including those of drawings, one a line."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self._silent = 0

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self._silent += tag in ("style", "script")
        self.lines += [value for name, value in attributes if name in ("alt", "aria-label", "title") and value]

    def handle_endtag(self, tag: str) -> None:
        self._silent -= tag in ("style", "script")

    def handle_data(self, data: str) -> None:
        if data.strip() and not self._silent:
            self.lines.append(" ".join(data.split()))


def text_of_page(html: str) -> str:
    """The text of a page, without style and pictures."""
    parser = _Text()
    parser.feed(html)
    parser.close()
    return "".join(f"{line}\n" for line in parser.lines)


def picture_of(page: Path, out: Path, profile: Path) -> None:
    """Save a screenshot of a page by Chromium; nothing if Chromium is not installed."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        return
    flags = ("headless", "no-sandbox", "disable-gpu", "no-first-run", "disable-background-networking",
             "hide-scrollbars", "force-device-scale-factor=1", "window-size=1000,6000",
             f"user-data-dir={profile}", f"screenshot={out}")  # fmt: skip
    out.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(
        [browser, *(f"--{flag}" for flag in flags), page.as_uri()], check=True, capture_output=True, timeout=180
    )


# What differs


def differences(kept: Path, made: Path) -> list[str]:
    """All differences between two folders, with their paths; pictures in only one of them are ignored."""
    names = sorted({path.relative_to(each).as_posix() for each in (kept, made) for path in _files(each)})
    found: list[str] = []
    for name in names:
        old, new = kept / name, made / name
        if not (old.exists() and new.exists()):
            if not name.endswith(".png"):
                found.append(f"{name}: only {'kept' if old.exists() else 'made now'}")
            continue
        compare = COMPARED.get(f"{name.partition('/')[0]}{Path(name).suffix}", text_apart)
        found += [f"{name}{words}" for words in compare(old.read_bytes(), new.read_bytes())]
    return found


def _files(folder: Path) -> Iterable[Path]:
    return (path for path in folder.rglob("*") if path.is_file())


def document_apart(old: bytes, new: bytes) -> list[str]:
    """Differences of two JSON documents: numbers within RELATIVE and NOUGHT, all else exactly."""
    return list(_apart(json.loads(old), json.loads(new), "", 0.0))


def _apart(old: Json, new: Json, path: str, scale: float) -> Iterator[str]:
    """The differences below a path; `scale` is the largest number in the list that contains the two values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted({*old, *new}):
            if key in old and key in new:
                yield from _apart(old[key], new[key], f"{path}/{key}", 0.0)
            else:
                yield f"{path}/{key}: only {'kept' if key in old else 'made now'}"
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{path}: {len(old)} entries kept, {len(new)} now"
            return
        largest = max((abs(each) for each in (*old, *new) if _is_number(each)), default=0.0)
        for number, pair in enumerate(zip(old, new, strict=True)):
            yield from _apart(*pair, f"{path}/{number}", largest)
    elif _is_number(old) and _is_number(new):
        bound = max(RELATIVE * max(abs(old), abs(new), scale), NOUGHT)
        if abs(old - new) > bound and old != new:
            yield f"{path}: {old!r} kept, {new!r} now (apart by {abs(old - new):.1e}, bound {bound:.1e})"
    elif type(old) is not type(new) or old != new:
        yield f"{path}: {_short(old)} kept, {_short(new)} now"


def _is_number(value: Json) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _short(value: Json) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 200 else f"{text[:200]}..."


def text_apart(old: bytes, new: bytes) -> list[str]:
    """The lines that differ; for a binary file the position of the first difference."""
    if old == new:
        return []
    try:
        before, after = old.decode().splitlines(), new.decode().splitlines()
    except UnicodeDecodeError:
        first = next(
            (i for i, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), min(len(old), len(new))
        )
        return [f": {len(old)} bytes kept, {len(new)} now, the first that differs is number {first}"]
    lines = [line for line in unified_diff(before, after, n=0, lineterm="") if line[:3] not in ("---", "+++")]
    return [f": {line}" for line in lines if line[:2] != "@@"] or [": the ends of lines differ"]


def picture_apart(old: bytes, new: bytes) -> list[str]:
    """The fraction of the pixels that differ, if it is above PIXELS."""
    from io import BytesIO

    from PIL import Image

    before, after = (np.asarray(Image.open(BytesIO(data)).convert("RGB"), dtype=np.int16) for data in (old, new))
    if before.shape != after.shape:
        return [f": {before.shape} kept, {after.shape} now"]
    share = float((np.abs(before - after) > 2).any(axis=-1).mean())
    return [f": {100 * share:.2f} % of the pixels differ"] if share > PIXELS else []


COMPARED: dict[str, Callable[[bytes, bytes], list[str]]] = {
    "results.json": document_apart,
    "pages.png": picture_apart,
}
"""Comparison by a file's folder and suffix; all others are compared as text."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; returns 1 if `compare` finds a difference."""
    parser = argparse.ArgumentParser(prog="python -m tools.freeze", description=__doc__)
    parser.add_argument("what", choices=("write", "compare"))
    parser.add_argument("folder", type=Path, help="outside of the repository; empty or new for write")
    given = parser.parse_args(words)
    folder = given.folder.resolve()
    if folder.is_relative_to(ROOT):
        parser.error(f"{given.folder} lies in the repository: name a folder outside of it.")
    if given.what == "write":
        if folder.exists() and any(folder.iterdir()):
            parser.error(f"{given.folder} is not empty: name another folder.")
        folder.mkdir(parents=True, exist_ok=True)
        photograph(folder / PHOTOS)
        make(folder / PHOTOS, folder / KEPT)
        print(f"{sum(1 for _ in _files(folder))} files kept in {folder}")
        return 0
    if not (folder / KEPT).is_dir():
        parser.error(f"{given.folder} holds nothing that `write` has kept.")
    with tempfile.TemporaryDirectory() as place:
        make(folder / PHOTOS, Path(place))
        found = differences(folder / KEPT, Path(place))
        pictures = len(list((folder / KEPT).glob("pages/*.png"))), len(list(Path(place).glob("pages/*.png")))
    for line in found:
        print(line)
    if pictures[0] != pictures[1]:
        print(f"note: {pictures[0]} pictures kept, {pictures[1]} made now; those without a partner were not compared")
    print(f"{len(found)} differences" if found else "no difference")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
