"""The limits of the chart search, in Python and in Kotlin."""

from __future__ import annotations

import re
from pathlib import Path

from camssf.photo.find import blobs, lattices, orientation, picture, sightings

ROOT = Path(__file__).parents[1]
KOTLIN = ROOT / "android-bindings" / "finder" / "src" / "main" / "kotlin" / "org" / "camssf" / "finder"


def kotlin_limits(name: str) -> dict[str, tuple[float, ...]]:
    """The constants that a file of the Kotlin finder declares, by their names."""
    source = KOTLIN / f"{name}.kt"
    found = re.findall(
        r"val ([A-Z_]+) = (?:doubleArrayOf\()?([-0-9., ]+)\)?$", source.read_text("utf-8"), re.MULTILINE
    )
    return {word: tuple(float(number) for number in numbers.split(",")) for word, numbers in found}


def test_both_languages_search_by_the_same_limits() -> None:
    """They are constants in both, since the search's inner loops read them: no rule that somebody may set."""
    table = {
        "Blobs": [
            ("MOST", blobs.MOST),
            ("CELL", blobs.CELL),
            ("SMALLEST_AREA", blobs.SMALLEST_AREA),
            ("LARGEST_SHARE", blobs.LARGEST_SHARE),
            ("FULL_LEAST", blobs.FULL[0]),
            ("FULL_MOST", blobs.FULL[1]),
            ("LONGEST_SHAPE", blobs.LONGEST_SHAPE),
        ],
        "Lattices": [
            ("NEAREST", lattices.NEIGHBOUR[0]),
            ("FARTHEST", lattices.NEIGHBOUR[1]),
            ("MOST_NEIGHBOURS", lattices.MOST_NEIGHBOURS),
            ("ALIKE", lattices.ALIKE),
            ("LENGTHS", lattices.SQUARE[0]),
            ("COSINE", lattices.SQUARE[1]),
            ("STEP", lattices.STEP),
            ("FEWEST", lattices.FEWEST),
            ("PLACE", lattices.PLACE),
            ("LEAST", lattices.SIZES[0]),
            ("MOST", lattices.SIZES[1]),
            ("WIDEST", lattices.WIDEST),
            ("FAR", lattices.FAR),
            ("BRIDGE", lattices.BRIDGE),
        ],
        "Orientation": [
            ("FLOOR", orientation.FLOOR),
            ("SPOTS", orientation.SPOTS),
            ("SEEN", orientation.SEEN),
            ("STRAY", orientation.STRAY),
            ("RING", orientation.RING),
        ],
        "ChartFinder": [
            ("SMALLEST", picture.SMALLEST),
            ("ACCEPT", orientation.ACCEPT),
            ("ACCEPT_LUMA", orientation.ACCEPT_LUMA),
            ("MOST_GRIDS", sightings.MOST_GRIDS),
        ],
        "Codes": [("LONGEST", picture.LONGEST), ("TOP", picture.TOP)],
    }
    for name, limits in table.items():
        found = kotlin_limits(name)
        for word, value in limits:
            assert found[word] == (value if isinstance(value, tuple) else (value,)), f"{name}.{word}"
