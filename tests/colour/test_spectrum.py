"""Reflectance from raw signals: its data, its posterior, the command."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camssf.colorimetry import signals_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_lamp
from camssf.spectra.bundled import SURFACE_NODES, surface_sets, surfaces
from camssf_colour import Camera, Reference, View
from camssf_colour.absorbance import INDICES, absorbance, index_weights, indices, shipped_index
from camssf_colour.posterior import LinearResponse, surface_posterior
from camssf_colour.reflectance import LitSurfaces, spectrum
from camssf_colour.surface_prior import SurfacePrior, prior_of, read_prior
from tests.colour.conftest import exact, known, power
from tests.spectra.test_spectra import columns


def test_the_library_holds_760_surfaces_and_97_skins() -> None:
    counts = dict.fromkeys(("general", "skin"), 0)
    for each in surface_sets():
        counts[each.kind] += len(each.values)
        assert each.values.shape[1:] == SURFACE_NODES.shape
        assert each.origin
        assert 0.0 <= each.values.min() < each.values.max() < 1.1
    assert counts == {"general": 760, "skin": 97}
    assert np.array_equal(surface_sets()[0].values, surfaces()[:, ::20])  # those of training are not stored twice


NODES = SURFACE_NODES.size


def on_grid(reflectance: Floats) -> Floats:
    return np.stack([np.interp(WAVELENGTHS, SURFACE_NODES, row) for row in reflectance])


def folded(camera: Camera, name: str = "D55") -> Floats:
    """(3, 35) signals of the unit functions: what `signals_of` gives, surface by surface."""
    return signals_of(on_grid(np.eye(NODES)), power(name), camera.values).T


def covariances(prior: SurfacePrior) -> Floats:
    """Of each surface, (N, 35, 35)."""
    changes = prior.shapes[:, None] * prior.changes
    return np.einsum("nv,vij->nij", prior.variances, prior.shared) + np.swapaxes(changes, 1, 2) @ changes


def a_few(count: int = 6) -> Floats:
    return surface_sets()[0].values[:: 190 // count][:count]


def photographed(name: str = "D55", rows: Floats | None = None, camera: Camera | None = None) -> Floats:
    """Signals of surfaces on the grid."""
    rows = a_few() if rows is None else rows
    return signals_of(on_grid(rows), power(name), (camera or exact()).values)


def test_spectra_reproduce_their_signals_and_colours() -> None:
    y = photographed()
    found = spectrum(exact(), LitSurfaces(known(), y, 1e-6, Reference(0.0)))
    assert np.allclose(found.standard_deviation**2, np.diagonal(found.covariance, axis1=1, axis2=2), rtol=1e-12)
    assert np.abs(signals_of(on_grid(found.reflectance), power(), exact().values) - y).max() < 1e-4
    from camssf_colour.standard import of_surfaces

    xyz, colours = of_surfaces(on_grid(found.reflectance), power(), View())
    assert np.abs(found.xyz - xyz).max() < 1e-12
    assert np.abs(found.lab - colours).max() < 1e-9
    assert np.sqrt(np.mean((found.reflectance - a_few())[:, 2:33] ** 2)) < 0.1


def test_a_file_is_a_prior(tmp_path: Path) -> None:
    rows = a_few()
    path = tmp_path / "leaves.csv"
    path.write_text(columns([f"leaf {i}" for i in range(len(rows))], rows, SURFACE_NODES), "utf-8")
    found, own = read_prior(str(path)), prior_of(rows)
    assert found.name == "leaves.csv"
    assert np.abs(found.shapes - own.shapes).max() < 1e-12
    assert np.abs(covariances(found) - covariances(own)).max() < 1e-12
    assert read_prior(found) is found


@pytest.mark.parametrize(
    "rows", [np.zeros((0, NODES)), np.zeros((2, NODES)), np.full((2, NODES), np.nan), np.ones((2, 4))]
)
def test_no_surfaces(rows: Floats) -> None:
    with pytest.raises(InvalidArgument):
        prior_of(rows)


@pytest.mark.parametrize("spec", ["", "fur", "https://example.org/skin.csv", "missing.csv", "own.csv"])
def test_an_unknown_prior(spec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.csv").write_text(",".join(["name", *map(str, range(380, 701, 20))]) + "\na,-1" + 16 * ",0.1", "utf-8")
    with pytest.raises(InvalidArgument, match="no reflectance" if spec == "own.csv" else None):
        read_prior(spec)


def test_what_is_no_photo() -> None:
    lit, two = (LitSurfaces("D55", [[0.3, 0.2, 0.1]] * count, 0.002) for count in (1, 2))
    unlit = replace(lit, lamp=replace(read_lamp("D55"), values=np.zeros(681)))
    for photos, words in (
        ((), "one or two"), ((lit, lit, lit), "one or two"), ((lit, replace(two, lamp="A")), "different numbers"),
        ((replace(lit, lamp="auto"),), "unknown"), ((unlit,), "no response"),
    ):  # fmt: skip
        with pytest.raises(InvalidArgument, match=words):
            spectrum(exact(), *photos)


def test_indices_are_means_of_absorbance(tmp_path: Path) -> None:
    """Of reflectance 10^-a with a straight line in a, means are values at the middle."""
    line = 0.1 + 0.001 * (SURFACE_NODES - 380.0)
    value = {name: float(absorbance(10.0**-line) @ shipped_index(name)) for name in INDICES}
    assert value["erythema"] == pytest.approx(0.001 * (557.5 - 650.0))
    assert value["melanin"] == pytest.approx(0.1 + 0.001 * (675.0 - 380.0))
    path = tmp_path / "slope.csv"
    path.write_text("nm,weight\n605,1\n700,-0.5\n", "utf-8")
    name, weights = index_weights(str(path))
    assert name == "slope"
    assert float(line @ weights) == pytest.approx(0.325 - 0.5 * 0.42)
    path.write_text("nm,weight\n605,1\n760,-0.5\n", "utf-8")
    for wrong, words in ((str(path), "outside 380 to 720"), ("redness", "No index")):
        with pytest.raises(InvalidArgument, match=words):
            index_weights(wrong)


def test_the_band_of_an_index_is_what_drawing_gives() -> None:
    found = spectrum(exact(), LitSurfaces("D55", photographed(rows=surface_sets()[-1].values[:1]), 0.002))
    rng = np.random.default_rng(3)
    drawn = rng.multivariate_normal(found.reflectance[0], found.covariance[0], 20_000, check_valid="ignore")
    for name in INDICES:
        value, std = indices(found, shipped_index(name))
        seen = absorbance(drawn) @ shipped_index(name)
        assert abs(seen.mean() - value[0]) < 0.2 * std[0]
        assert std[0] == pytest.approx(seen.std(), rel=0.1)


def test_colour_science_takes_the_spectra() -> None:
    colour = pytest.importorskip("colour")
    found = spectrum(exact(), LitSurfaces("D55", photographed(), 0.002))
    table = found.to_colour()
    assert isinstance(table, colour.MultiSpectralDistributions)
    assert np.array_equal(table.values.T, found.reflectance)
    assert np.array_equal(table.wavelengths, SURFACE_NODES)


@pytest.mark.full
def test_the_posterior_is_what_drawing_gives() -> None:
    """Importance sampling: surfaces, errors and the level, of which nothing is known before, are drawn."""
    rng = np.random.default_rng(5)
    rows = surface_sets()[-1].values[[0, 9, 18, 27, 36, 45]]
    prior, a = prior_of(rows, counts=np.array([1.0, 2.0, 1.0, 1.0, 3.0, 1.0])), folded(exact())
    moves = 0.006 * rng.normal(size=(2, 3, NODES)) * a
    asked = np.stack([np.eye(NODES)[10], np.eye(NODES)[25], folded(exact(), "A")[1]])
    asked_moves = 0.02 * rng.normal(size=(2, 1, NODES)) * asked[2]
    response = LinearResponse(a, moves, asked, asked_moves, {"curves": slice(0, 1), "lamp": slice(1, 2)})
    y = (a @ (0.5 * (rows[1] + rows[4])))[None] * [1.01, 1.0, 0.99]
    error = 0.025 * y
    found = surface_posterior(prior, response, y, error)

    level, draws = y.mean(), 800_000
    weights = np.exp(prior.log_weights)
    which = rng.choice(len(weights), size=draws, p=weights / weights.sum())
    scale = (prior.shapes @ a.T).mean(axis=1)
    values, log = np.empty((draws, 3)), np.empty(draws)
    for i in range(len(weights)):
        mine = which == i
        x, n = rng.normal(size=(mine.sum(), 2)), rng.normal(size=mine.sum())
        root = np.linalg.cholesky(covariances(prior)[i] + 1e-12 * np.eye(NODES)) / scale[i]
        centre, apart = prior.shapes[i] / scale[i], rng.normal(size=(mine.sum(), NODES)) @ root.T
        seen = (centre + apart) @ a.T + np.einsum("ne,ecj,j->nc", x, moves, centre)
        size = level * (1.0 + 0.06 * n)
        log[mine] = 0.5 * n**2 - 0.5 * np.sum(((y[0] - size[:, None] * seen) / error[0]) ** 2, axis=1)
        drawn_outputs = (centre + apart) @ asked.T
        drawn_outputs[:, 2] += np.einsum("ne,ej,j->n", x, asked_moves[:, 0], centre)
        values[mine] = drawn_outputs * size[:, None] / level
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    assert 1.0 / np.sum(weight**2) > 2_000, "too few draws count"
    mean = weight @ values
    covariance = (weight[:, None] * (values - mean)).T @ (values - mean)
    std = np.sqrt(np.diagonal(covariance))
    assert np.abs(found.mean[0] / level - mean).max() < 0.06 * std.min()
    assert np.abs((found.covariance[0] / level**2 - covariance) / np.outer(std, std)).max() < 0.06
