"""Makes data/spectra.json from colour-science: the lamps and charts that Python and Kotlin read.

`python -m tools.tabulate` writes the file, `--check` tests that colour-science, the families and the layouts still
give the same. Reading a lamp or a chart does not use this module.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf.files import write_file
from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.spectra import colour_science
from camssf.spectra.bundled import FORMAT
from camssf.spectra.charts import MEASURED_CHART, PUBLIC_CHART
from camssf.spectra.families import DIMMEST, FAMILIES, DrawnKind, Temperature, principal_modes
from camssf.spectra.lamps import MEASURED_LAMP, NAMED_LAMP, NOISE_BELOW_ZERO
from camssf.spectra.layouts import LAYOUTS
from tools.lamp_kinds import drawn_kind
from tools.pages import parser, write_or_check

Json: TypeAlias = dict[str, Any]
COMMAND = "python -m tools.tabulate"
PLACE = Path(__file__).parents[1] / "reference" / "camssf" / "data" / "spectra.json"
ILLUMINANTS = (
    *("A", "B", "C", "D50", "D55", "D60", "D65", "D75", "E", "ID50", "ID65"),
    *(f"FL{i}" for i in range(1, 13)),
    *(f"FL3.{i}" for i in range(1, 16)),
    *(f"HP{i}" for i in range(1, 6)),
    *(f"LED-B{i}" for i in range(1, 6)),
    *("LED-BH1", "LED-RGB1", "LED-V1", "LED-V2"),
)
KELVIN = {"A": 2856.0, "D50": 5003.0, "D55": 5503.0, "D60": 6003.0, "D65": 6504.0, "D75": 7504.0}
"""Colour temperatures of lamps that have one, K, for c₂ = 1.4388e-2 m K."""
TABLES = {"babelcolor": "BabelColor Average", "ohta": "ColorChecker N Ohta"}
"""Chart tables by the word after the colon in `classic24:ohta`; the first is the default."""
CHARTS = ("classic24", "nano24", "mini24", "passport24")
WHITE = "white 9.5 (.05 D)"
EXACT = 1e-12
"""Largest difference between a family's modes and those computed from its stored weights."""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 1 if `--check` finds a difference."""
    check = parser(COMMAND, "Write data/spectra.json, or check it.").parse_args(arguments).check
    made = tabulate()
    if not check:
        write_file(PLACE, as_text(made))
        print(f"{len(made['lamps'])} lamps, {len(made['tables'])} chart tables, {PLACE.stat().st_size / 1e3:.0f} kB")
        return 0
    faults = drift(json.loads(PLACE.read_text("utf-8")), made)
    for fault in faults:
        print(fault)
    print(f"{len(faults)} of {len(made)} parts drifted")
    if faults:
        print(f"If that is meant, run `{COMMAND}`.", file=sys.stderr)
    return int(bool(faults))


def tabulate() -> Json:
    """The file's content, from colour-science and camssf's own definitions."""
    science = colour_science()
    daylight = science.colorimetry.datasets.illuminants.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    return {
        "format": FORMAT,
        "generator": COMMAND,
        "origin": origin(),
        "grid": {"start": float(WAVELENGTHS[0]), "step": STEP, "count": WAVELENGTHS.size},
        "tolerances": {
            "named_lamp": NAMED_LAMP,
            "measured_lamp": MEASURED_LAMP,
            "public_chart": PUBLIC_CHART,
            "measured_chart": MEASURED_CHART,
            "noise_below_zero": NOISE_BELOW_ZERO,
        },
        "lamps": {name: _even(science.SDS_ILLUMINANTS[name]) for name in ILLUMINANTS},
        "kelvin": KELVIN,
        "daylight": _daylight(daylight),
        "observer": _observer(science.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]),
        "families": {name: _family(name, science) for name in FAMILIES},
        "charts": {"names": list(CHARTS), "tables": TABLES},
        "tables": {name: _chart(science.SDS_COLOURCHECKERS[name]) for name in TABLES.values()},
        "layouts": {
            name: {"columns": each.columns, "rows": each.rows, "side": list(each.side), "products": each.products}
            for name, each in LAYOUTS.items()
        },
    }


def drift(stored: Json, made: Json) -> list[str]:
    """The parts that differ; the weights of a family may differ by rounding."""
    faults = [f"{key} differs" for key in made if key != "families" and stored.get(key) != made[key]]
    faults += [f"there is no part {key}" for key in stored if key not in made]
    families = stored.get("families", {})
    if list(families) != list(made["families"]):
        return [*faults, "families differ"]
    parts = [(name, family, families[name]) for name, family in made["families"].items()]
    for name, family, known in list(parts):
        shapes = family.get("shapes", []), known.get("shapes", [])
        if len(shapes[0]) != len(shapes[1]):
            faults.append(f"the family {name} differs in its shapes")
        parts += [(f"{name}/{i}", *pair) for i, pair in enumerate(zip(*shapes, strict=False), 1)]
    for name, family, known_family in parts:
        ours, theirs = (
            {key: value for key, value in one.items() if key != "shapes"} for one in (family, known_family)
        )
        rounding = 2e-7 if "share" not in family else 2e-5
        for key, bound in (("weights", 1e-9), ("modes", rounding), ("mean", rounding)):
            values, known = np.array(ours.pop(key, [])), np.array(theirs.pop(key, []))
            if values.shape != known.shape or np.abs(values - known).max(initial=0.0) > bound:
                faults.append(f"the family {name} differs in {key}")
        if ours != theirs:
            faults.append(f"the family {name} differs")
    return faults


def origin() -> Json:
    """Name, version, licence and URL of colour-science, the source of a file."""
    return {
        "name": "colour-science",
        "version": version("colour-science"),
        "licence": "BSD-3-Clause",
        "url": "https://github.com/colour-science/colour",
    }


def made_file(command: str, place: Path, make: Callable[[], Json], arguments: Sequence[str] | None) -> int:
    """Run the command of a JSON file that is exactly reproducible: write it, or with `--check` compare it."""
    check = parser(command, f"Write data/{place.name}, or check it.").parse_args(arguments).check
    return write_or_check(command, place.parent, {place.name: as_text(make())}, check=check)


def as_text(value: Json) -> str:
    """The value as JSON, with one line for each row of numbers."""

    def lines(value: Any, indent: str) -> str:
        inner = indent + " "
        if isinstance(value, dict) and value:
            parts = [f"{json.dumps(key)}: {lines(each, inner)}" for key, each in value.items()]
            return "{\n" + ",\n".join(inner + part for part in parts) + f"\n{indent}}}"
        if isinstance(value, list) and value and isinstance(value[0], list):
            return "[\n" + ",\n".join(inner + lines(each, inner) for each in value) + f"\n{indent}]"
        return json.dumps(value, allow_nan=False, ensure_ascii=False)

    return lines(value, "") + "\n"


def digest(values: Any) -> str:
    """SHA-256, hex, of numbers as little-endian float64 in row-major order."""
    return hashlib.sha256(np.asarray(values, "<f8").tobytes()).hexdigest()


def _even(table: Any) -> Json:
    """A spectrum with equal wavelength steps, as JSON."""
    nm, values = np.asarray(table.wavelengths, float), np.asarray(table.values, float)
    step = float(nm[1] - nm[0])
    if not np.array_equal(nm, nm[0] + step * np.arange(nm.size)):
        raise ValueError(f"{table.name}: uneven wavelengths")
    return {"start": float(nm[0]), "step": step, "sha256": digest(values), "values": values.tolist()}


def _daylight(parts: Any) -> Json:
    spectra = {name: _even(parts[name]) for name in ("S0", "S1", "S2")}
    start, step = spectra["S0"]["start"], spectra["S0"]["step"]
    values = {name: each["values"] for name, each in spectra.items()}
    return {"start": start, "step": step, "sha256": digest(list(values.values()))} | values


def _observer(table: Any) -> Json:
    """The colour-matching functions from 380 to 720 nm."""
    rows = [i for i, nm in enumerate(table.wavelengths) if WAVELENGTHS[0] <= nm <= WAVELENGTHS[-1]]
    start, after = (float(table.wavelengths[i]) for i in rows[:2])
    values = {name: np.asarray(table.values)[rows, c].tolist() for c, name in enumerate("xyz")}
    return {"start": start, "step": after - start, "sha256": digest(list(values.values()))} | values


def _chart(table: Any) -> Json:
    rows = [_even(each) for each in table.values()]
    names = [str(name) for name in table]
    values = [row["values"] for row in rows]
    return {
        "start": rows[0]["start"],
        "step": rows[0]["step"],
        "white": names.index(WHITE),
        "patches": names,
        "sha256": digest(values),
        "values": values,
    }


def _family(name: str, science: Any) -> Json:
    """The definition of a family; for a family of tabulated lamps also the weights that give its modes.

    With L_i divided by its mean over the grid: the mean lamp is the mean of L_i; mode k is Σ_i weights[k][i] L_i
    divided by the larger of the mean lamp and `dimmest` times its peak.
    """
    family = FAMILIES[name]
    if isinstance(family, Temperature):
        return {"formula": "planck", "centre": family.centre, "spread": family.spread, "tolerance": NAMED_LAMP}
    if isinstance(family, DrawnKind):
        return {"source": family.words} | drawn_kind(name)
    lamps: list[Floats] = []
    for member in family.members:
        table = science.SDS_ILLUMINANTS[member]
        lamps.append(np.interp(WAVELENGTHS, table.wavelengths, table.values))
    mean, modes = principal_modes(lamps, family.components)
    modes = modes * np.maximum(mean, DIMMEST * mean.max())
    shapes = np.stack([lamp / lamp.mean() for lamp in lamps])
    weights = modes @ np.linalg.pinv(shapes - mean)
    weights *= np.sign(np.take_along_axis(weights, np.abs(weights).argmax(axis=1)[:, None], axis=1))
    if np.abs(np.abs(weights @ shapes) - np.abs(modes)).max() > EXACT:
        raise ValueError(f"{name}: the modes are no sums of the members")
    return {
        "members": list(family.members),
        "dimmest": DIMMEST,
        "tolerance": family.left,
        "weights": weights.tolist(),
    }


if __name__ == "__main__":
    sys.exit(main())
