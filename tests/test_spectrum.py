"""Reflectance from raw signals: its data, its posterior, the command."""

import csv
import hashlib
from pathlib import Path

import numpy as np
import pytest

from camssf.spectra.surfaces import SURFACE_NODES, absorbers, surface_sets, surfaces
from tools import surfaces as tool

ROOT = Path(__file__).parents[1]


# -- data -------------------------------------------------------------------------------------------------------


def test_the_library_holds_760_surfaces_and_97_skins() -> None:
    counts = dict.fromkeys(("general", "skin"), 0)
    for each in surface_sets():
        counts[each.kind] += len(each.values)
    assert counts == {"general": 760, "skin": 97}
    for each in surface_sets():
        assert each.values.shape[1:] == SURFACE_NODES.shape
        assert each.origin
        assert 0.0 <= each.values.min() < each.values.max() < 1.1


@pytest.mark.parametrize("name", tool.FILES)
def test_each_measured_set_is_its_file(name: str) -> None:
    path = ROOT / "data" / "surfaces" / f"{name}.csv"
    with path.open(encoding="utf-8") as file:
        rows = [[float(cell) for cell in row] for row in list(csv.reader(file))[1:]]
    stored = next(each for each in tool.tabulate()["library"]["sets"] if each["name"] == name)
    found = next(each.values for each in surface_sets() if each.name == name)
    assert stored["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest()
    at = {row[0]: row[1:] for row in rows}
    for nm in set(at) & set(SURFACE_NODES):
        assert np.abs(found[:, round((nm - 380.0) / 10.0)] - at[nm]).max() <= 0.5 * tool.UNIT + 1e-12


def test_the_training_surfaces_are_not_stored_twice() -> None:
    first = surface_sets()[0]
    assert (first.name, len(first.values)) == ("rawtoaces", 190)
    assert np.array_equal(first.values, surfaces()[:, ::20])


def test_haemoglobin_absorbs_where_it_does() -> None:
    """Oxyhaemoglobin has a valley at 560 nm between two bands, deoxyhaemoglobin a band there; red passes both."""
    oxy, deoxy, bilirubin = (absorbers()[name] for name in ("oxyhaemoglobin", "deoxyhaemoglobin", "bilirubin"))
    at = {int(nm): i for i, nm in enumerate(SURFACE_NODES)}
    assert oxy[at[540]] > oxy[at[560]] < oxy[at[580]]
    assert deoxy[at[560]] > oxy[at[560]]
    assert deoxy[at[660]] > 5.0 * oxy[at[660]]
    assert bilirubin.argmax() == at[460]
