"""The page of a report: well formed, drawn to scale, its words those that were read; whatever its numbers are."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps

from camssf.documents.document import Curves
from camssf.grid import WAVELENGTHS
from camssf.recovery.basis import read_basis
from camssf.report.build import report
from camssf.report.sections import patches as patch_view
from camssf.report.sections import photos as photo_view
from camssf.report.sections.curves import curves_of
from camssf.verdict.reasons import Verdict
from tests.report.conftest import TAGS, Page, html_of, number, patches_in, points, put
from tests.support.documents import CHANNELS, changed, document, known, preview, refused, unnamed

STORED = Path(__file__).with_name("pages.txt")


def test_the_curves_are_drawn_smooth_through_the_document_s_values() -> None:
    """The straight lines between values every 5 nm are not to be seen; no peak moves and nothing overshoots."""
    phone = read_basis("phones").mean.T
    for values, step in ((phone, 20), (read_basis("cameras").mean.T, 10)):
        values = values / values.max(axis=0)
        made = changed(document(), answer__curves=Curves.of(values), answer__std=None)
        drawn, shown = curves_of(made), curves_of(made).smooth()
        assert np.abs(shown.ssf - values)[::step].max() < 1e-12
        assert np.abs(shown.ssf - values).max() < 0.07
        assert np.array_equal(shown.ssf.argmax(axis=0), values.argmax(axis=0))
        assert shown.ssf.max() <= 1 + 1e-12
        assert np.array_equal(drawn.ssf, values)  # the numbers stay those of the document
        bends = [np.abs(np.diff(each, 2, axis=0)).max() for each in (shown.ssf, values)]
        assert bends[0] < 0.6 * bends[1]


def test_page_is_well_formed_accessible_and_needs_nothing_else() -> None:
    made = html_of(document("D55", "A"), [preview(), None])
    page = Page(made)
    assert page.open == []
    tags = [tag for tag, _ in page.tags]
    assert set(tags) <= TAGS
    assert ("html", {"lang": "en-GB"}) in page.tags
    assert tags.count("h1") == 1
    assert tags.count("table") == tags.count("caption") >= 6
    for tag, attributes in page.tags:
        assert tag == "image" or attributes.get("role") != "img" or attributes["aria-label"]
        assert "src" not in attributes
        for key in ("href", "xlink:href"):
            assert (attributes.get(key) or "#").startswith(("#", "data:"))
    assert not re.search(r"@import|url\((?!#)|https?://", made)
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


@cache
def words_of_pages() -> str:
    """The words of a page of each status that no page before it has, each line once, without numbers alone.

    The accepted one is of an unnamed light, signed, and compared with another.
    """
    accepted = unnamed()
    (dirty,) = (check for check in accepted.verdict.checks if check.name == "dirty")
    checks = tuple(replace(c, value=0.5 * c.limit) if c is dirty else c for c in accepted.verdict.checks)
    accepted = changed(accepted, verdict=Verdict("accepted", (), checks))
    pages = {
        "accepted": html_of(accepted, [preview()], known(accepted)),
        "doubtful": html_of(document("D55", "A"), [preview()]),
        "refused": html_of(refused(shots=True), [preview()]),
    }
    lines: dict[str, None] = {}
    for status, page in pages.items():
        lines |= dict.fromkeys((f"# {status}", *(" ".join(word.split()) for word in Page(page).words)))
    return "".join(f"{line}\n" for line in lines if re.search("[A-Za-z]{3}", line))


def test_the_pages_words_are_those_that_were_read_and_kept() -> None:
    """`python -m tests.report.test_page` writes the file anew; read the difference before you commit it."""
    assert words_of_pages() == STORED.read_text("utf-8")


def test_curves_are_drawn_to_scale() -> None:
    made = document()
    page = Page(html_of(made))
    wide = next(i for i, (_, a) in enumerate(page.tags) if a.get("class") == "plot wide")
    for colour, values in zip(CHANNELS, made.curves.T, strict=True):
        line = points(next(a["d"] for _, a in page.tags[wide:] if a.get("class") == f"curve {colour}"))
        for drawn, meant in ((line[:, 0], WAVELENGTHS[::2]), (line[:, 1], values[::2])):
            fit = np.polynomial.Polynomial.fit(meant, drawn, 1)
            assert np.abs(fit(meant) - drawn).max() < 0.06  # half of the last digit, px
        assert line[:, 0].min() >= 0
        assert np.ptp(line[:, 0]) > 1000
        assert line[np.argmax(values[::2]), 1] == line[:, 1].min()  # up is more


def test_tiles_carry_measured_left_and_synthetic_right() -> None:
    made = document()
    page, patches = Page(html_of(made)), patches_in(made)
    at = [i for i, (_, a) in enumerate(page.tags) if a.get("class") == "tile"]
    assert len(at) == 24
    for i, name, *colours in zip(at, patches.names, patches.measured_srgb, patches.synthetic_srgb, strict=True):
        for half, colour in zip(page.tags[i + 1 : i + 3], colours, strict=True):
            assert half[1]["style"] == "background:#" + "".join(f"{round(255 * v):02x}" for v in colour)
        assert name in (page.tags[i][1]["aria-label"] or "")
    assert any(a.get("style") == "--columns:6" for _, a in page.tags)


def test_residuals_are_predicted_minus_measured() -> None:
    made = document()
    patches, mean = patches_in(made), made.capture.shots[0].means.chart.mean  # type: ignore[union-attr]
    dim = patches.dark[6] + (patches.white - patches.dark)[6] * [0.0, 0.1, 0.1]  # no light, no relative error
    wild = 2.5 * patches.signal[5]  # + 150 %: beyond any scale
    unseen = put(patches.unseen[None], (0, 5), wild)
    made = changed(made, capture__shots__0__means__chart__mean=put(mean, 6, dim), answer__unseen=unseen)
    page, patches = html_of(made), patches_in(made)
    rows = re.findall(r'<tr><th scope="row"><span class="swatch".*?</tr>', page, re.DOTALL)
    assert len(rows) == 24
    for i, row in enumerate(rows):
        shown = re.findall(r'class="value">([^<]*)<', row)
        unseen = bool(np.isfinite(patches.unseen[i]).all())
        guess = patches.unseen[i] if unseen else patches.predicted[i]
        want = [100 * (g - y) / y for g, y in zip(guess, patches.signal[i], strict=True) if y > 0]
        assert [number(cell) for cell in shown] == pytest.approx(want, abs=0.051)
        assert ("hollow" in row) == (not unseen)
        assert ("not fitted" in row) == (not patches.used[i])
    assert rows[5].count("<path") == 3
    assert rows[6].count("–</td>") == 1
    # A dot left of the middle is a negative residual.
    for x, shown in re.findall(r'<circle class="full" cx="([\d.]+)%".*?class="value">([^<]*)<', page, re.DOTALL):
        assert number(shown) == 0 or (float(x) > 50) == (number(shown) > 0)


def test_a_bar_holds_noise_and_what_the_prediction_leaves_open() -> None:
    plain = document()
    unseen = np.isfinite(patches_in(plain).unseen)
    banded = changed(
        plain, answer__predicted_std=np.full((1, 24, 3), 0.5), answer__unseen_std=np.where(unseen, 1.0, np.nan)[None]
    )
    assert "the measurement&#39;s own noise" in html_of(plain)
    page, patches = html_of(banded), patches_in(banded)
    assert "own noise" not in page
    assert f"Of {unseen.sum()} unseen values 100% lie within their bars." in page
    by_hand = 100 * 1.96 * np.hypot(np.where(unseen, 1.0, 0.5), patches.standard_error) / patches.signal
    assert patch_view.errors(patches)[1] == pytest.approx(by_hand, rel=1e-4)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_outlines_follow_the_orientation(orientation: int) -> None:
    """As Pillow turns a picture of one bright pixel."""
    stored = np.zeros((5, 7), np.uint8)
    stored[1, 4] = 255
    image = Image.fromarray(stored)
    image.getexif()[274] = orientation
    (row,), (column,) = np.nonzero(np.asarray(ImageOps.exif_transpose(image)))
    point = photo_view.upright([4, 1], 7, 5, orientation)
    assert point.tolist() == [column + 0.5, row + 0.5]  # the middle of that pixel


@pytest.mark.parametrize(("orientation", "size"), [(1, (4032, 3024)), (6, (3024, 4032))])
def test_the_photo_is_drawn_once_and_turned_with_its_outlines(orientation: int, size: tuple[int, int]) -> None:
    made = changed(document(), capture__shots__0__photo__orientation=orientation)
    page = Page(html_of(made, [preview()]))
    (image,) = [a for tag, a in page.tags if tag == "image"]
    assert (image["width"], image["height"]) == ("4032", "3024")
    a, b, c, d, e, f = (int(v) for v in (image["transform"] or "")[7:-1].split())
    outlines = [tag["points"] for name, tag in page.tags if name == "polygon"]
    assert len(outlines) == 25
    quad = made.capture.shots[0].pose.patches[0] + 0.5
    want = np.stack([a * quad[:, 0] + c * quad[:, 1] + e, b * quad[:, 0] + d * quad[:, 1] + f], axis=-1)
    np.testing.assert_allclose(points(outlines[1]), want, atol=0.051)
    assert any(attributes.get("viewbox") == f"0 0 {size[0]} {size[1]}" for _, attributes in page.tags)


@pytest.mark.parametrize("dark", [12, 24])
def test_odd_numbers_still_draw(dark: int) -> None:
    """Signed and tiny curves, huge bands, a chart of no size, no signal: nothing breaks, no nan or inf is drawn."""
    made = document()
    patches, wave = patches_in(made), np.cos(WAVELENGTHS / 9)
    mean = (patches.dark + (patches.white - patches.dark) * [2e-6, 0.0, -1.0])[:dark]
    made = changed(
        made, answer__curves__red=wave / wave.max(), answer__std__green=np.full(681, 1e12),
        answer__scores__rmsre_percent=np.array([1e9, 0.0, 1e-9]), answer__scores__rmse=None,
        answer__scores__delta_e00=0.0, answer__unseen=np.full((1, 24, 3), 1e12),
        capture__shots__0__means__chart__mean=put(patches.chart, slice(dark), mean),
        capture__shots__0__pose__corners=np.full((4, 2), 5.0),
        capture__shots__0__pose__patches=np.full((24, 4, 2), 5.0), capture__shots__0__photo__exposure=0.0,
        capture__shots__0__photo__iso=None, truth__curves__blue=np.zeros(681),
        truth__curves__green=put(np.ones(681), slice(2), [-1e12, 1e12]),
    )  # fmt: skip
    result = report(made)
    assert not re.search(r'="[^"]*\b(nan|inf)\b', result.html)
    assert not re.search(r'="[^"]*\b(nan|inf)\b', result.ssf_svg or "nan")


if __name__ == "__main__":
    STORED.write_text(words_of_pages(), "utf-8")
