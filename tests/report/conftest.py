"""Pages of results made by formulas, and their parts."""

import re
from collections.abc import Callable, Iterator, Sequence
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from camssf.documents import forms
from camssf.documents.document import Document
from camssf.grid import Floats
from camssf.report.page import page as render
from camssf.report.provenance import NO_PROVENANCE, Provenance
from camssf.report.shots import shots_of
from camssf_colour import report as colour

_TAGS = """html head meta title link style body main header footer section div p h1 h2 h3 ul li dl dt dd span strong
small code sub sup br table caption thead tbody tr th td details summary figure figcaption
svg g path line rect circle text tspan polygon image use clippath"""
TAGS = frozenset(_TAGS.split())


@pytest.fixture(autouse=True, scope="session")
def colours_once() -> Iterator[None]:
    """A page's colour errors take most of its time, and most pages here are of the same curves."""

    def once(function: Callable[..., Any], key: Callable[..., object]) -> Callable[..., Any]:
        made: dict[str, Any] = {}

        def call(*arguments: Any) -> Any:
            name = repr(key(*arguments))
            made[name] = made[name] if name in made else function(*arguments)
            return made[name]

        return call

    def parts(made: Document) -> object:
        """What the colour error depends on."""
        shot = made.capture.shots[0]
        return forms.content_hash(forms.to_plain([made.answer, made.verdict, shot.lamp])), shot.means.white is None

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(colour, "expected_error", once(colour.expected_error, parts))
        by_bytes = once(colour.true_error, lambda *curves: [curve.tobytes() for curve in curves])
        patch.setattr(colour, "true_error", by_bytes)
        yield


def html_of(made: Document, previews: Sequence[bytes | None] = (), provenance: Provenance = NO_PROVENANCE) -> str:
    """The page of `report`, without the picture, which takes longer."""
    shots = shots_of(made)
    return render(made, shots, [*previews, *[None] * (len(shots) - len(previews))], provenance)


def put(values: Floats, at: Any, value: Any) -> Floats:
    """A copy of an array with another value at a place."""
    copy = values.copy()
    copy[at] = value
    return copy


def patches_in(made: Document) -> Any:
    """Those of the first shot, as they are shown."""
    return shots_of(made)[0].patches


class Page(HTMLParser):
    """Tags, attributes and text of a page; text in a style element is left out."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(page)
        self.close()

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in ("meta", "link", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "title"):
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))

    def of_class(self, name: str) -> list[dict[str, str | None]]:
        """Attributes of the elements of a class."""
        return [attributes for _, attributes in self.tags if attributes.get("class") == name]


def points(way: str | None) -> Floats:
    """(n, 2) the corners of a path or polygon."""
    return np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", way or ""), dtype=float)


def number(text: str) -> float:
    return float(text.replace("\u2212", "-"))
