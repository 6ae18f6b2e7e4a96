"""What does Kotlin's CaptureGuide say of faults that are known?

Sequences of 640 × 480 preview frames by the simulated camera (`camssf_lab.simulation`): a measured camera's curves, a
colour matrix of three numbers a channel, a tone curve that is not sRGB's, noise, 4:2:0 colours, a hand that trembles.
Each has one fault, or none. The guide was built on other drawings (`Drawn.kt`), and none of its limits was set here.
Without `--search` it is told where the chart lies; with it, ChartFinder looks for it, and the time counts both.
Needs `mvn -f android-bindings test-compile`.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.claim import Run
from benchmarks.kernels.turns import BINDINGS, Unavailable
from camssf.grid import Floats
from camssf.spectra import ChartTable, read_camera, read_chart, read_lamp
from camssf_lab.simulation.scene import FOCAL, Scene, project, render_mosaic, true_pose

OPTIONS = {"search": (False, "let ChartFinder look for the chart")}
FRAMES = 20
"""A sequence: 0.7 s at 30 frames a second."""

SIZE = (640, 480)
RATE = 30.0
JUDGE = "org.camssf.guide.GuideJudge"
COLOURS = np.array([[1.55, -0.45, -0.10], [-0.20, 1.45, -0.25], [0.02, -0.42, 1.40]])
"""From the camera's white-balanced channels to a display's: as a maker would choose them, about."""

Shade = Callable[[Floats, Floats, Floats], Floats]
"""Linear light (h, w, 3), u, v (h, w) on the chart in pitches → the light as it arrives."""


@dataclass(frozen=True)
class Sequence:
    """Frames with one fault.

    Attributes:
        fault: what is wrong, in words, with how much.
        wanted: the advice that is right; `also`: what is right, too.
        scene: the geometry; shade: what happens to the light; speed: px a frame, to the right.
        exposure: level of an ideal white.
        lamp, camera: by name.
        number: if the advice has an amount that is known, what it should be, and by how much it may be off.
    """

    fault: str
    wanted: str
    scene: Scene
    shade: Shade | None = None
    speed: float = 0.0
    exposure: float = 0.72
    lamp: str = "D55"
    camera: str = "Nikon 5100 (NPL)"
    number: tuple[float, float] | None = None
    also: tuple[str, ...] = ()
    seed: int = field(default=0)


def spot(u: float, v: float, radius: float, strength: float) -> Shade:
    return lambda light, x, y: (
        light + (strength * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * radius**2)))[..., None]
    )


def shadow(angle: float, off: float, factor: float, soft: float) -> Shade:
    """Light less by `factor` beyond a line, over a width of `soft` pitches."""
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))

    def shade(light: Floats, x: Floats, y: Floats) -> Floats:
        beyond = 1 / (1 + np.exp(-np.clip(((x - 2.5) * c + (y - 1.5) * s - off) / soft * 4, -50, 50)))
        return np.asarray(light * (1 - (1 - factor) * beyond)[..., None])

    return shade


def slope(angle: float, stops: float) -> Shade:
    """Light that falls by `stops` from one end of the block to the other, as 1 / r² of a near lamp."""
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    half = abs(2.94 * c) + abs(1.94 * s)
    ratio = 2 ** (stops / 2)
    far = half * (ratio + 1) / (ratio - 1)

    def shade(light: Floats, x: Floats, y: Floats) -> Floats:
        distance = np.maximum(far + (x - 2.5) * c + (y - 1.5) * s, 0.2 * far)
        return np.asarray(light * ((far / distance) ** 2)[..., None])

    return shade


def wall(colour: tuple[float, float, float], share: float) -> Shade:
    """A wall of this colour over this share of the picture's surroundings, from the left."""

    def shade(light: Floats, x: Floats, y: Floats) -> Floats:
        outside = (np.abs(x - 2.5) > 3.4) | (np.abs(y - 1.5) > 2.4)
        seen = np.arange(light.shape[1]) < share * light.shape[1]
        there = outside & seen[None, :]
        return np.where(there[..., None], np.array(colour), light)

    return shade


def sequences() -> list[Sequence]:
    """Faults of three sizes each in several poses, and captures without one."""
    poses = [
        Scene(size=SIZE, fill=0.45, blur=0.6),
        Scene(size=SIZE, fill=0.38, rotation=90, tilt=8, blur=0.6, centre=(0.54, 0.48)),
        Scene(size=SIZE, fill=0.55, rotation=183, tilt=-10, blur=0.6, centre=(0.47, 0.5), surround="black"),
    ]
    found: list[Sequence] = []

    def add(fault: str, wanted: str, change: Callable[[Scene], Scene] = lambda scene: scene, **more: Any) -> None:
        for scene in poses:
            found.append(Sequence(fault, wanted, change(scene), seed=len(found), **more))

    add("none", "NOW")
    add("none, a bulb", "NOW", lamp="A")
    add("none, another camera", "NOW", camera="Canon EOS 600D", exposure=0.6)
    add("none, a slope of 0.1 stops", "NOW", shade=slope(30, 0.1))
    add("none, a wooden desk", "NOW", shade=wall((0.30, 0.22, 0.15), 1.0))
    for tilt in (28, 40, 50):
        add(f"tilt of {tilt}°", "TILTED", lambda scene, tilt=tilt: replace(scene, tilt=tilt, fill=0.45),
            number=(tilt, 4.0))  # fmt: skip
    add("a fifth of the width", "TOO_FAR", lambda scene: replace(scene, fill=0.19))
    add("at the border", "CUT", lambda scene: replace(scene, centre=(0.70, 0.5), fill=0.55, rotation=4))
    for stops in (-2, -3, -4):
        add(f"{stops} EV", "TOO_DARK", exposure=0.72 * 2.0**stops, number=(-stops, 0.8))
    for stops in (1, 2, 3):
        add(f"+{stops} EV, clipped", "TOO_BRIGHT", exposure=0.72 * 2.0**stops, number=(stops, 0.8))
    for blur in (3, 4, 6):
        add(f"blur of {blur} px", "OUT_OF_FOCUS", lambda scene, blur=blur: replace(scene, blur=blur))
    for speed in (2, 4, 8):
        add(f"moving, {speed} px a frame", "MOVING", speed=speed)
    for strength in (0.12, 0.25, 0.5):
        add(f"a spot of {strength} on the second row", "GLARE", shade=spot(3.2, 1.2, 0.6, strength), exposure=0.6)
    add("a small spot on the greys", "GLARE", shade=spot(4.1, 3.0, 0.22, 0.4), exposure=0.6)
    add("a veil of 0.15", "GLARE", lambda scene: replace(scene, glare=0.15), exposure=0.6)
    for angle, factor in ((20, 0.65), (100, 0.5), (230, 0.35)):
        add(f"a shadow at {angle}°, {1 - factor:.0%} darker", "SHADOW", shade=shadow(angle, 0.3, factor, 0.15),
            also=("TOO_DARK",) if factor < 0.5 else ())  # fmt: skip
    for stops in (0.5, 1.0, 1.5):
        add(f"a slope of {stops} stops", "UNEVEN", shade=slope(160, stops), exposure=0.55, number=(stops, 0.4))
    for colour, share in (((0.6, 0.15, 0.12), 0.6), ((0.1, 0.35, 0.1), 1.0), ((0.1, 0.2, 0.5), 1.0)):
        add(f"a wall of {colour}, {share:.0%} of the view", "TINTED", shade=wall(colour, share))
    return found


def linear(sequence: Sequence, table: ChartTable) -> Floats:
    """(h, w, 3) of one frame as a display's linear light, before it is cut to 0 to 1."""
    camera, lamp = read_camera(sequence.camera), read_lamp(sequence.lamp)
    white = lamp.values @ camera.values
    patches = np.einsum("nm,m,mc->nc", table.values, lamp.values, camera.values) / white
    planes = np.empty((SIZE[1], SIZE[0], 3))
    double = replace(sequence.scene, size=(2 * SIZE[0], 2 * SIZE[1]), blur=2 * sequence.scene.blur)
    mosaic = render_mosaic(double, patches, np.ones(3), "RGGB").astype(np.float64)
    planes[..., 0] = mosaic[0::2, 0::2]
    planes[..., 1] = (mosaic[0::2, 1::2] + mosaic[1::2, 0::2]) / 2
    planes[..., 2] = mosaic[1::2, 1::2]
    view = project(sequence.scene, patches, np.ones(3), "RGGB")
    if sequence.shade is not None:
        planes = sequence.shade(planes, view.u.astype(np.float64), view.v.astype(np.float64))
    return np.asarray(planes @ COLOURS.T * sequence.exposure)


def coded(light: Floats) -> Floats:
    """A maker's tone curve: a power of 1/2.1, and a little more contrast in the middle. 0 to 255."""
    t = np.clip(light, 0, 1) ** (1 / 2.1)
    return np.asarray(255 * (0.85 * t + 0.15 * t * t * (3 - 2 * t)))


def yuv(rgb: NDArray[np.float32]) -> bytes:
    """I420, full range."""
    r, g, b = (rgb[..., channel] for channel in range(3))
    y = 0.299 * r + 0.587 * g + 0.114 * b
    planes = [y]
    for colour, scale in ((b, 1.772), (r, 1.402)):
        full = 128 + (colour - y) / scale
        planes.append((full[0::2, 0::2] + full[0::2, 1::2] + full[1::2, 0::2] + full[1::2, 1::2]) / 4)
    return b"".join(np.clip(np.rint(plane), 0, 255).astype(np.uint8).tobytes() for plane in planes)


@cache
def noise() -> NDArray[np.float32]:
    """Four fields of a sensor's noise, 1.8 of 255, which frames take in turn and shifted."""
    return np.random.default_rng(8).normal(scale=1.8, size=(4, SIZE[1], SIZE[0], 3)).astype(np.float32)


def frames(sequence: Sequence, table: ChartTable) -> Iterator[tuple[bytes, Floats]]:
    """Each frame's bytes and the chart's true corners in it."""
    rng = np.random.default_rng((41, sequence.seed))
    values = coded(linear(sequence, table)).astype(np.float32)
    corners = true_pose(sequence.scene).corners
    tremor = np.zeros(2)
    for number in range(FRAMES):
        tremor = 0.8 * tremor + rng.normal(scale=0.25, size=2)
        shift = np.rint(tremor).astype(int)
        shift[0] += round(sequence.speed * (number - FRAMES / 2))
        moved = np.roll(values, (int(shift[1]), int(shift[0])), axis=(0, 1))
        noisy = moved + np.roll(noise()[number % 4], tuple(rng.integers(0, 400, 2)), axis=(0, 1))
        yield yuv(np.clip(noisy, 0, 255, out=noisy)), corners + shift


def class_path() -> str:
    """The compiled bindings and what they need of the local Maven repository."""
    home = Path(os.environ.get("MAVEN_REPOSITORY", Path.home() / ".m2" / "repository"))
    pom = (BINDINGS / "pom.xml").read_text(encoding="utf-8")

    def pin(name: str) -> str:
        found = re.search(rf"<{name}.version>(.*?)<", pom)
        return found.group(1) if found else ""

    kotlin, json_ = pin("kotlin"), pin("serialization")
    places = [BINDINGS / module / "target" / "classes" for module in ("model", "core", "finder")]
    places.append(BINDINGS / "finder" / "target" / "test-classes")
    places.append(home / f"org/jetbrains/kotlin/kotlin-stdlib/{kotlin}/kotlin-stdlib-{kotlin}.jar")
    for part in ("core", "json"):
        name = f"kotlinx-serialization-{part}-jvm"
        places.append(home / f"org/jetbrains/kotlinx/{name}/{json_}/{name}-{json_}.jar")
    for place in places:
        if not place.exists():
            raise Unavailable(f"{place} is missing: run mvn -f android-bindings test-compile.")
    return os.pathsep.join(str(place) for place in places)


class Judge:
    """One warm JVM with a guide for each sequence."""

    def __init__(self, path: str, search: bool) -> None:
        self.process = subprocess.Popen(
            [
                *("java", "-Xmx256m", "-XX:+UseSerialGC", "-XX:ActiveProcessorCount=1", "-cp", path),
                *(JUDGE, str(FOCAL), "search" if search else "told"),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, file: Path, corners: list[Floats]) -> list[dict[str, Any]]:
        """What is said after each frame."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        numbers = " ".join(repr(float(value)) for four in corners for value in four.ravel())
        self.process.stdin.write(f"{SIZE[0]} {SIZE[1]} {len(corners)} {RATE} {numbers} {file}\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            raise Unavailable("the JVM has ended; its error is above.")
        return list(json.loads(answer))

    def close(self) -> None:
        """Ends it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def is_right(sequence: Sequence, last: dict[str, Any]) -> bool:
    """Whether the last advice is right."""
    return last["advice"] in (sequence.wanted, *sequence.also)


def claim(run: Run) -> None:
    """A row a fault, and the totals."""
    table, said = read_chart("classic24"), []
    judge = Judge(class_path(), run.options.search)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frames.yuv"
        for sequence in run.track(sequences(), "sequences"):
            drawn = list(frames(sequence, table))
            file.write_bytes(b"".join(frame for frame, _ in drawn))
            said.append((sequence, judge.ask(file, [corners for _, corners in drawn])))
    judge.close()
    rows = []
    for fault in dict.fromkeys(sequence.fault for sequence, _ in said):
        own = [(sequence, answers[-1]) for sequence, answers in said if sequence.fault == fault]
        wrong = Counter(last["advice"] for sequence, last in own if not is_right(sequence, last))
        near = [
            abs(last["amount"] - sequence.number[0]) <= sequence.number[1] for sequence, last in own
            if sequence.number is not None and last["advice"] == sequence.wanted
        ]  # fmt: skip
        rows.append((
            fault, own[0][0].wanted, (sum(is_right(*pair) for pair in own), len(own)),
            (sum(near), len(near)) if near else None, ", ".join(f"{name} {count}" for name, count in wrong.items()),
        ))  # fmt: skip
    columns = {"fault": "", "right advice": "", "right": "{} of {}", "number near": "{} of {}", "instead": ""}
    run.table("what the guide says", columns, rows)
    faulty, clean = (
        [(one, answers[-1]) for one, answers in said if (one.wanted == "NOW") == good] for good in (False, True)
    )
    changes = [sum(a["advice"] != b["advice"] for a, b in pairwise(answers)) for _, answers in said]
    run.say(
        f"{sum(is_right(*pair) for pair in faulty)} of {len(faulty)} faults named, "
        f"{sum(last['advice'] == 'NOW' for _, last in faulty)} called good; {sum(is_right(*pair) for pair in clean)} "
        f"of {len(clean)} good ones called good; advice changed {np.mean(changes):.1f} times a sequence"
    )
    times, garbage = (
        np.array([frame[key] for _, answers in said[3:] for frame in answers]) for key in ("milliseconds", "bytes")
    )
    run.say(
        f"{np.median(times):.1f} ms of processor a frame (95 %: {np.quantile(times, 0.95):.1f}), "
        f"{np.median(garbage) / 1e3:.0f} kB of garbage, {'search and guide' if run.options.search else 'guide alone'}"
    )
    run.bar("ms of processor a frame, median", np.median(times), most=25.0)
    run.bar("MB of garbage a frame, median", np.median(garbage) / 1e6, most=1.0)
