"""Reflectance from raw signals: its data, its posterior, the command."""

import csv
import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camssf.colorimetry import signals_of
from camssf.errors import InvalidArgument, LampUnfit
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra import read_lamp
from camssf.spectra.bundled import SURFACE_NODES, absorbers, surface_sets, surfaces
from camssf_colour import Camera, Reference, View
from camssf_colour.absorbance import INDICES, absorbance, index_weights, indices, shipped_index
from camssf_colour.light import see, see_together
from camssf_colour.posterior import LinearResponse, surface_posterior
from camssf_colour.reflectance import FAR, LitSurfaces, SurfaceSpectra, spectrum
from camssf_colour.surface_prior import NEIGHBOURS, ROUGHNESS, SurfacePrior, prior_of, read_prior, skin_changes
from tests.colour.conftest import blurred, exact, known, owned, power
from tools import surfaces as tool

ROOT = Path(__file__).parents[2]


# -- data -------------------------------------------------------------------------------------------------------


def test_the_library_holds_760_surfaces_and_97_skins() -> None:
    counts = dict.fromkeys(("general", "skin"), 0)
    for each in surface_sets():
        counts[each.kind] += len(each.values)
        assert each.values.shape[1:] == SURFACE_NODES.shape
        assert each.origin
        assert 0.0 <= each.values.min() < each.values.max() < 1.1
    assert counts == {"general": 760, "skin": 97}
    assert np.array_equal(surface_sets()[0].values, surfaces()[:, ::20])  # those of training are not stored twice


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


def test_haemoglobin_absorbs_where_it_does() -> None:
    """Oxyhaemoglobin has a valley at 560 nm between two bands, deoxyhaemoglobin a band there; red passes both."""
    oxy, deoxy, bilirubin = (absorbers()[name] for name in ("oxyhaemoglobin", "deoxyhaemoglobin", "bilirubin"))
    at = {int(nm): i for i, nm in enumerate(SURFACE_NODES)}
    assert oxy[at[540]] > oxy[at[560]] < oxy[at[580]]
    assert deoxy[at[560]] > oxy[at[560]]
    assert deoxy[at[660]] > 5.0 * oxy[at[660]]
    assert bilirubin.argmax() == at[460]


# -- the posterior against judges of its own -----------------------------------------------------------------------

NODES = SURFACE_NODES.size
NONE: dict[str, slice] = {"curves": slice(0, 0)}


def on_grid(reflectance: Floats) -> Floats:
    return np.stack([np.interp(WAVELENGTHS, SURFACE_NODES, row) for row in reflectance])


def folded(camera: Camera, name: str = "D55") -> Floats:
    """(3, 35) signals of the unit functions: what `signals_of` gives, surface by surface."""
    return signals_of(on_grid(np.eye(NODES)), power(name), camera.values).T


def plain(rows: Floats) -> LinearResponse:
    """Reflectance from exact signals."""
    none = np.zeros((0, NODES))
    return LinearResponse(rows, np.zeros((0, *rows.shape)), np.eye(NODES), np.zeros((0, *none.shape)), NONE)


def covariances(prior: SurfacePrior) -> Floats:
    """Of each surface, (N, 35, 35)."""
    changes = prior.shapes[:, None] * prior.changes
    return np.einsum("nv,vij->nij", prior.variances, prior.shared) + np.swapaxes(changes, 1, 2) @ changes


def a_few(count: int = 6) -> Floats:
    return surface_sets()[0].values[:: 190 // count][:count]


def test_one_surface_without_noise_is_a_gaussian_conditioned_by_hand() -> None:
    """One surface, its level unknown: R = k s + u with u of covariance F, k by generalised least squares."""
    row, a = a_few()[2], folded(exact())
    shape = row / row.mean()
    steps = (SURFACE_NODES[:, None] - SURFACE_NODES) / 20.0
    roughness = 0.008**2 * np.exp(-0.5 * steps**2)
    assert ROUGHNESS == 0.008
    y = a @ row * [1.0, 1.01, 0.99]
    covariance = (y.mean() / (a @ shape).mean()) ** 2 * roughness
    gain = np.linalg.solve(a @ covariance @ a.T, a @ covariance).T
    inverse = np.linalg.inv(a @ covariance @ a.T)
    seen = a @ shape
    precision = seen @ inverse @ seen
    k = seen @ inverse @ y / precision
    left = shape - gain @ seen
    found = surface_posterior(prior_of(row[None]), plain(a), y[None], np.zeros((1, 3)))
    assert np.abs(found.mean[0] - k * shape - gain @ (y - k * seen)).max() < 1e-9
    expected = covariance - gain @ a @ covariance + np.outer(left, left) / precision
    assert np.abs(found.covariance[0] - expected).max() < 1e-9
    assert np.abs(a @ found.mean[0] - y).max() < 1e-9


def test_a_surface_of_the_prior_explains_its_own_signals() -> None:
    row, a = a_few()[3], folded(exact())
    found = surface_posterior(prior_of(row[None]), plain(a), (a @ row)[None], np.zeros((1, 3)))
    assert np.abs(found.mean[0] - row).max() < 1e-9
    assert found.distance[0] < 1e-6


def test_two_equal_photos_are_one_with_less_noise() -> None:
    prior, a, y = prior_of(a_few()), folded(exact()), np.array([[0.3, 0.22, 0.17]])
    error = 0.02 * y
    twice = surface_posterior(prior, plain(np.concatenate([a, a])), np.tile(y, 2), np.tile(error, 2))
    once = surface_posterior(prior, plain(a), y, error / np.sqrt(2.0))
    assert np.abs(twice.mean - once.mean).max() < 1e-9
    assert np.abs(twice.covariance - once.covariance).max() < 1e-9


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


# -- spectra ------------------------------------------------------------------------------------------------------


def photographed(name: str = "D55", rows: Floats | None = None, camera: Camera | None = None) -> Floats:
    """Signals of surfaces on the grid."""
    rows = a_few() if rows is None else rows
    return signals_of(on_grid(rows), power(name), (camera or exact()).values)


def rms(found: SurfaceSpectra, truth: Floats) -> float:
    return float(np.sqrt(np.mean((found.reflectance - truth)[:, 2:33] ** 2)))


def test_spectra_reproduce_their_signals_and_colours() -> None:
    y = photographed()
    found = spectrum(exact(), LitSurfaces(known(), y, 1e-6, Reference(0.0)))
    assert np.abs(signals_of(on_grid(found.reflectance), power(), exact().values) - y).max() < 1e-4
    from camssf_colour.standard import of_surfaces

    xyz, colours = of_surfaces(on_grid(found.reflectance), power(), View())
    assert np.abs(found.xyz - xyz).max() < 1e-12
    assert np.abs(found.lab - colours).max() < 1e-9
    assert rms(found, a_few()) < 0.1


@pytest.mark.parametrize("white", ["lamp", "D65"])
def test_more_light_scales_a_spectrum_and_its_band(white: str) -> None:
    y = photographed()
    one, other = (
        spectrum(blurred(), LitSurfaces("D55", k * y, k * 0.01 * y), view=View(white=white)) for k in (1.0, 0.5)
    )
    assert np.abs(0.5 * one.reflectance - other.reflectance).max() < 1e-12
    assert np.abs(0.25 * one.covariance - other.covariance).max() < 1e-12
    assert np.abs(one.from_photo - other.from_photo).max() < 1e-9


def test_the_parts_add_up() -> None:
    found = spectrum(blurred(), LitSurfaces("D55", photographed(), 0.003))
    assert set(found.parts) == {"curves", "lamp", "noise", "reference", "metamers"}
    assert np.abs(sum(found.parts.values()) - found.covariance).max() < 1e-15
    assert all(np.linalg.eigvalsh(part).min() > -1e-9 for each in found.parts.values() for part in each)
    assert np.allclose(found.standard_deviation**2, np.diagonal(found.covariance, axis1=1, axis2=2), rtol=1e-12)


def test_a_second_light_tells_more() -> None:
    rows = surface_sets()[1].values[::5]
    lit = [LitSurfaces(name, photographed(name, rows), 0.002) for name in ("D65", "LED-B3")]
    one, two = spectrum(exact(), lit[0]), spectrum(exact(), *lit)
    assert rms(two, rows) < 0.8 * rms(one, rows)
    assert two.from_photo.mean() > one.from_photo.mean()


def test_what_no_surface_gives_is_far_from_the_prior() -> None:
    y = np.stack([photographed()[0], [0.9, 0.05, 0.8]])
    found = spectrum(exact(), LitSurfaces("D55", y, 0.002), prior="skin")
    assert found.distance[1] > FAR
    inside = spectrum(exact(), LitSurfaces("D55", photographed(rows=surface_sets()[-1].values), 0.002), prior="skin")
    assert inside.distance.max() < FAR


def test_skin_is_told_more_exactly_by_the_prior_of_skin() -> None:
    rows = surface_sets()[-1].values[::7]
    lit = LitSurfaces("D55", photographed(rows=rows), 0.002)
    general, skin = spectrum(exact(), lit), spectrum(exact(), lit, prior="skin")
    assert max(rms(general, rows), rms(skin, rows)) < 0.02


def test_the_light_that_nobody_named_is_mixed() -> None:
    camera, y = owned(blurred()), photographed("A")
    raw = power("A") @ camera.values
    lit = LitSurfaces("auto", y, 0.002, Reference(0.01, raw, 0.002))
    found = spectrum(camera, lit)
    assert sum(weight for _, weight in found.lamps) == pytest.approx(1.0)
    assert max(found.lamps, key=lambda each: each[1])[0] == ("bulb",)
    both = spectrum(camera, lit, LitSurfaces("D55", photographed(), 0.002))
    assert len(both.lamps) == len(found.lamps)
    assert all(names[1] == "D55" for names, _ in both.lamps)
    with pytest.raises(LampUnfit):
        spectrum(camera, replace(lit, lamp="D75"))


def test_photos_seen_together() -> None:
    """A second photo without a usable white changes nothing of the first; with one it narrows the curves."""
    camera, lamps = owned(blurred()), [read_lamp("D55"), read_lamp("A")]
    raws = [lamp.values @ camera.values for lamp in lamps]
    ratios = [np.log(raw[[0, 2]] / raw[1]) for raw in raws]
    alone = see(camera, lamps[0], ratios[0], 0.005)
    first, second = see_together(camera, lamps, [ratios[0], None], [0.005, 0.0])
    assert np.abs(first.curves - alone.curves).max() < 1e-12
    assert np.abs(first.power - alone.power).max() < 1e-12
    assert first.of_lamp == second.of_lamp
    both = see_together(camera, lamps, ratios, [0.005, 0.005])[0]
    of = [np.sum(light.curve_modes**2) for light in (alone, first, both)]
    assert of[1] == pytest.approx(of[0])
    assert of[2] < of[0]


# -- priors -------------------------------------------------------------------------------------------------------


def test_a_file_is_a_prior(tmp_path: Path) -> None:
    rows = a_few()
    path = tmp_path / "leaves.csv"
    lines = [",".join(["name", *(f"{nm:g}" for nm in SURFACE_NODES)])]
    lines += [",".join([f"leaf {i}", *(repr(float(value)) for value in row)]) for i, row in enumerate(rows)]
    path.write_text("\n".join(lines), "utf-8")
    found, own = read_prior(str(path)), prior_of(rows)
    assert found.name == "leaves.csv"
    assert np.abs(found.shapes - own.shapes).max() < 1e-12
    assert np.abs(covariances(found) - covariances(own)).max() < 1e-12
    assert read_prior(found) is found


def test_the_shipped_priors() -> None:
    general, skin = read_prior("general"), read_prior("skin")
    assert (len(general.shapes), len(skin.shapes)) == (857, 97)
    assert np.unique(np.exp(general.log_weights)).round(6).tolist() == [1.0, 8.0]
    narrow = prior_of(np.concatenate([each.values for each in surface_sets() if each.kind == "skin"]))
    changes = skin_changes()
    assert len(changes) == 5
    for relative in changes:
        change = relative * skin.shapes
        wider = np.einsum("ni,nij,nj->n", change, covariances(skin) - covariances(narrow), change)
        assert (wider >= np.sum(change**2, axis=1) ** 2 * (1 - 1e-9)).all()


def test_strong_absorption_saturates() -> None:
    """Of the two layers of oxyhaemoglobin the deeper one shows less of the band at 415 nm against that at 540 nm."""
    above, below = skin_changes()[:2] / skin_changes()[:2, [16]]
    assert above[4] > 4.0 * below[4] > 4.0


def test_neighbours_give_the_width() -> None:
    """A tenfold spread of the shapes is a tenfold width, but for the roughness."""
    rng = np.random.default_rng(2)
    shapes = 1.0 + 0.02 * (off := rng.normal(size=(NEIGHBOURS + 4, NODES)) - 0.0)
    off -= off.mean(axis=1, keepdims=True)
    small, large = (covariances(prior_of(1.0 + size * off)) for size in (0.002, 0.02))
    floor = covariances(prior_of(shapes[:1]))[0]
    assert np.abs((large - floor) - 100.0 * (small - floor)).max() < 1e-9


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
    lit = LitSurfaces("D55", [[0.3, 0.2, 0.1]], 0.002)
    with pytest.raises(InvalidArgument, match="one or two"):
        spectrum(exact())
    with pytest.raises(InvalidArgument, match="one or two"):
        spectrum(exact(), lit, lit, lit)
    with pytest.raises(InvalidArgument, match="different numbers"):
        spectrum(exact(), lit, LitSurfaces("A", [[0.3, 0.2, 0.1]] * 2, 0.002))
    with pytest.raises(InvalidArgument, match="unknown"):
        spectrum(exact(), replace(lit, lamp="auto"))
    with pytest.raises(InvalidArgument, match="no response"):
        spectrum(exact(), replace(lit, lamp=replace(read_lamp("D55"), values=np.zeros(681))))


# -- indices ------------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("seed", range(6))
def test_curves_that_no_camera_has_are_answered_or_refused(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curves = exact().values.copy()
    curves[:, rng.integers(3)] *= rng.choice([1e-9, -1.0, 1e9])
    curves[:, rng.integers(3)] = rng.normal(size=681)
    camera = Camera("none", np.where(curves.max(axis=0) > 0, curves, 1.0), 10.0 ** rng.integers(3) * blurred().modes)
    try:
        found = spectrum(camera, LitSurfaces("auto" if seed % 2 else "A", [[1e-300, 1e5, 1e9]], 10.0**seed))
    except InvalidArgument:
        return
    assert np.isfinite(found.reflectance).all()
    assert (found.standard_deviation >= 0).all()
