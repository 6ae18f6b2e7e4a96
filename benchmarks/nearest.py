"""Is a camera found among the known ones? `python -m benchmarks.nearest [--cameras 13]`

Measured cameras, each recovered with a basis that does not know its maker, as benchmarks.colour does it (chart of
another table, lamps off by their 2 %), from one shot (D55) and from two (D55, A). How often the camera's own table is
the nearest of the 52, or among the nearest three: by the bands, by the whole covariance, by the plain difference
(`camssf.report.nearest`); and the distance of the own table.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from benchmarks._common import console, one_thread, progress, save, table, versions
from benchmarks.colour import SEED, SHOTS, calibrate, cases
from camssf.report.nearest import likenesses

WAYS = ("distance", "whole", "rms")


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.nearest", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--cameras", type=int, default=13, help="of the 52, evenly over their list")
    told = parser.parse_args(arguments)
    rng = np.random.default_rng(SEED)
    places: dict[str, dict[str, list[int]]] = {word: {way: [] for way in WAYS} for word in SHOTS}
    own: dict[str, dict[str, list[float]]] = {word: {way: [] for way in WAYS} for word in SHOTS}
    chosen = cases(told.cameras, None)
    with progress() as bar:
        task = bar.add_task("cameras", total=len(chosen))
        for case in chosen:
            for word, lamps in SHOTS.items():
                camera = calibrate(case, lamps, rng, off=True)
                found = likenesses(camera.values, np.sqrt(np.sum(camera.modes**2, axis=0)), camera.modes)
                for way in WAYS:
                    far = [float(getattr(each, way)) for each in found]
                    here = next(value for each, value in zip(found, far, strict=True) if each.name == case.name)
                    places[word][way].append(sum(value < here for value in far))
                    own[word][way].append(here)
            bar.advance(task)
    content = {
        word: {
            way: {
                "first": float(np.mean(np.array(places[word][way]) == 0)),
                "among_three": float(np.mean(np.array(places[word][way]) < 3)),
                "own": float(np.mean(own[word][way])),
                "worst_own": float(np.max(own[word][way])),
            }
            for way in WAYS
        }
        for word in SHOTS
    }
    rows = [
        (
            word,
            way,
            f"{row['first']:.2f}",
            f"{row['among_three']:.2f}",
            f"{row['own']:.3f}",
            f"{row['worst_own']:.3f}",
        )
        for word, ways in content.items()
        for way, row in ways.items()
    ]
    head = ("shots", "by", "first", "among three", "own distance", "largest")
    console().print(table(f"a camera's own table among the 52, {len(chosen)} cameras", head, rows))
    print(save("nearest", {"cameras": [case.name for case in chosen], **content, "versions": versions("scipy")}))
    return 0


if __name__ == "__main__":
    one_thread("benchmarks.nearest")
    sys.exit(main())
