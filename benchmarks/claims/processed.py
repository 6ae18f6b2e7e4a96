"""Which RAW that a program has processed is noticed by its noise?

Charts by four measured cameras under three lamps, each with three sensors (10, 12 and 14 bits, full wells of 2,000 to
20,000 electrons), in focus and out of it, bright and dim, with a lens that loses half of the light in the corners. As
the sensor gave them (`clean`), and harmless: four exposures merged, binned by two. Then processed: demosaiced
bilinearly or by Malvar, He and Cutler's filters, changed, and sampled as a mosaic again.

Counted is rule 11 of docs/verdict.md alone, on true poses. Bars: clean and merged at most 1 % doubted, denoised
without mixing at most 4 %; mixed by 15 % and more, chroma noise reduction, and resized with mixing at least 90 %.

`--clean` counts clean captures alone, of 55 kinds: eleven sensors (also 600 electrons, one channel at half the gain,
thermal signal, a black level of 0) and five scenes; 660 in ten minutes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve, gaussian_filter, median_filter, zoom

from benchmarks.claim import Run
from camssf.grid import Floats
from camssf.photo.find.pose import Pose
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.verdict.processed import processed
from camssf.verdict.reasons import Checks
from camssf_colour.demosaic import demosaic
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene
from camssf_lab.simulation.shot import photograph

OPTIONS = {"clean": (False, "clean captures alone, of 55 kinds")}
CAMERAS = ("Nikon 5100 (NPL)", "Canon EOS 5DS", "Sony ILCE-9", "Demo phone")
LAMPS = ("D55", "A", "LED-B3")
SENSORS = (
    Sensor(black=64.0, white_level=1023, full_well=5000.0),
    Sensor(black=256.0, white_level=4095, full_well=2000.0, read_noise=2.0),
    Sensor(black=512.0, white_level=16383, full_well=20000.0, read_noise=4.0),
)
SCENES = (
    Scene(size=(1600, 1200)),
    Scene(size=(1600, 1200), blur=1.5, tilt=15.0),
    Scene(size=(1600, 1200), vignetting=0.5, rotation=10.0),
)
CLEAN_SENSORS = (
    *SENSORS, Sensor(black=64.0, white_level=1023, full_well=600.0, read_noise=1.5),
    Sensor(black=16.0, white_level=1023, full_well=1200.0), Sensor(black=0.0, white_level=4095, full_well=2500.0),
    Sensor(black=1024.0, white_level=16383, full_well=1200.0, read_noise=1.5),
    Sensor(black=2048.0, white_level=15600, full_well=50000.0, read_noise=5.0),
    Sensor(gains=(0.5, 1.0, 1.3), full_well=3000.0), Sensor(dark_current=30.0, read_noise=8.0, full_well=8000.0),
    Sensor(exposure=0.15, full_well=6000.0),
)  # fmt: skip
CLEAN_SCENES = (
    *SCENES,
    Scene(size=(1600, 1200), glare=0.03, blur=3.0),
    Scene(size=(1600, 1200), fill=0.35, tilt=25.0),
)
SATURATION = np.array([[1.5, -0.35, -0.15], [-0.25, 1.4, -0.15], [-0.05, -0.45, 1.5]])

MERGED = "four exposures merged"
Change = Callable[[Floats], Floats]
"""Of the light above black (h, w), RGGB."""


def colours(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """The colour of each sample."""
    return np.tile(np.array([[0, 1], [1, 2]]), (shape[0] // 2, shape[1] // 2))


def bilinear(light: Floats) -> Floats:
    """(h, w, 3)."""
    own, kernel = colours(light.shape), np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]])
    full = [convolve(light * (own == c), kernel) / convolve((own == c) * 1.0, kernel) for c in range(3)]
    return np.stack([np.where(own == c, light, one) for c, one in enumerate(full)], axis=2)


def malvar(light: Floats) -> Floats:
    """(h, w, 3)."""
    height, width = light.shape
    cells = np.pad(light, 2, mode="reflect").reshape(height // 2 + 2, 2, width // 2 + 2, 2)
    return np.moveaxis(demosaic(cells).reshape(3, height, width), 0, 2)


def mosaicked(full: Floats) -> Floats:
    """(h, w)."""
    return np.take_along_axis(full, colours(full.shape[:2])[:, :, None], axis=2)[:, :, 0]


def mixed(share: float, demosaic: Change = bilinear, matrix: Floats | None = None) -> Change:
    """Colours mixed by a share of a matrix, by default of grey."""
    mix = np.eye(3) * (1.0 - share) + share * (np.full((3, 3), 1.0 / 3.0) if matrix is None else matrix)
    return lambda light: mosaicked(demosaic(light) @ mix.T)


def chroma(smooth: Callable[[Floats], Floats]) -> Change:
    """What differs from grey is smoothed."""

    def change(light: Floats) -> Floats:
        full = bilinear(light)
        grey = full.mean(axis=2, keepdims=True)
        return mosaicked(grey + np.stack([smooth((full - grey)[:, :, c]) for c in range(3)], axis=2))

    return change


def by_plane(smooth: Callable[[Floats], Floats]) -> Change:
    """Each position of the mosaic is changed for itself, so no colours mix."""

    def change(light: Floats) -> Floats:
        done = light.copy()
        for y, x in np.ndindex(2, 2):
            done[y::2, x::2] = smooth(light[y::2, x::2])
        return done

    return change


def resized(light: Floats) -> Floats:
    """To 98 % and desaturated by 15 %; the rest of the frame stays empty."""
    full = bilinear(light) @ (np.eye(3) * 0.85 + 0.05)
    small = np.stack([zoom(full[:, :, c], 0.98, order=1) for c in range(3)], axis=2)
    done = np.zeros_like(full)
    height, width = (size // 2 * 2 for size in small.shape[:2])
    done[:height, :width] = small[:height, :width]
    return mosaicked(done)


@dataclass(frozen=True)
class Kind:
    """A kind of processing.

    Attributes:
        change: of the light; None for none.
        least, most: bars of the share that is doubted; None for no bar.
        size: of the picture afterwards, relative.
    """

    change: Change | None
    least: float | None = None
    most: float | None = None
    size: float = 1.0


KINDS = {
    "clean": Kind(None, most=0.01),
    "demosaiced, not mixed": Kind(mixed(0.0)),
    "desaturated 5 %": Kind(mixed(0.05)),
    "desaturated 10 %": Kind(mixed(0.10)),
    "desaturated 15 %": Kind(mixed(0.15), least=0.9),
    "desaturated 15 %, Malvar": Kind(mixed(0.15, malvar), least=0.9),
    "desaturated 35 %": Kind(mixed(0.35), least=0.9),
    "saturated by a matrix, half": Kind(mixed(0.5, malvar, SATURATION), least=0.9),
    "chroma noise reduction, Gaussian": Kind(chroma(lambda c: gaussian_filter(c, 2.0)), least=0.9),
    "chroma noise reduction, median": Kind(chroma(lambda c: median_filter(c, 5)), least=0.9),
    "denoised by plane": Kind(by_plane(lambda c: gaussian_filter(c, 0.6)), most=0.04),
    "resized to 98 %, desaturated 15 %": Kind(resized, least=0.9, size=0.98),
}


def reasons(light: Floats, sensor: Sensor, pose: Pose) -> list[str]:
    """Keys of rule 11's reasons."""
    samples = np.clip(np.rint(light + sensor.black), 0, sensor.white_level).astype(np.uint16)
    photo = Mosaic(
        path="chart", samples=samples, cfa="RGGB", black=np.full((2, 2), sensor.black),
        white=float(sensor.white_level),
        make="", model="", exposure=None, iso=None, orientation=1, gain_maps=(), color_matrix1=None,
        color_matrix2=None, as_shot_neutral=None, sha256="",
    )  # fmt: skip
    return [reason.key for reason in processed(measure_patches(photo, pose), 0, Checks())]


def clean_captures() -> Iterator[list[str]]:
    """Keys of rule 11's reasons of each clean capture."""
    chart, kinds = read_chart("classic24"), product(CLEAN_SENSORS, CLEAN_SCENES, CAMERAS, LAMPS)
    for seed, (sensor, scene, camera, lamp) in enumerate(kinds, 1):
        frame = photograph(read_camera(camera), read_lamp(lamp), chart, scene, sensor, (seed, 9))
        yield reasons(frame.chart.astype(float) - sensor.black, sensor, frame.pose)


def captures() -> Iterator[tuple[Floats, Floats, Sensor, Pose]]:
    """The light of one exposure and of four merged ones, with sensor and true pose."""
    chart = read_chart("classic24")
    for seed, (camera, lamp, sensor) in enumerate(product(CAMERAS, LAMPS, SENSORS), 1):
        scene = SCENES[(seed - 1) % len(SCENES)]
        dim = replace(sensor, exposure=(0.8, 0.35)[seed % 2])
        frames = [photograph(read_camera(camera), read_lamp(lamp), chart, scene, dim, (seed, i)) for i in range(4)]
        light = np.stack([frame.chart.astype(float) - dim.black for frame in frames])
        yield light[0], light.mean(axis=0), dim, frames[0].pose


def claim(run: Run) -> None:
    """A row a kind of processing; or clean captures alone."""
    found: dict[str, list[list[str]]] = {}
    if run.options.clean:
        found["clean"] = list(run.track(clean_captures(), "clean captures"))
    else:
        for light, merged, sensor, pose in run.track(captures(), "captures"):
            for name, kind in KINDS.items():
                changed = light if kind.change is None else kind.change(light)
                seen = replace(pose, patches=pose.patches * kind.size)
                found.setdefault(name, []).append(reasons(changed, sensor, seen))
            found.setdefault(MERGED, []).append(reasons(merged, sensor, pose))
    rows = []
    for name, every in found.items():
        kind = KINDS.get(name, KINDS["clean"])
        doubted = np.mean([bool(keys) for keys in every])
        counts = Counter(key for keys in every for key in keys)
        rows.append((name, len(every), doubted, ", ".join(f"{key} {n}" for key, n in sorted(counts.items()))))
        if kind.least is not None or kind.most is not None:
            run.bar(name, doubted, least=kind.least, most=kind.most)
    run.table("Processed RAW", {"kind": "", "captures": "d", "doubted": ".2f", "reasons": ""}, rows)
