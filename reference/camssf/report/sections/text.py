"""Formats texts and numbers of the page, safe for HTML."""

from __future__ import annotations

import math
import re

from markupsafe import Markup, escape

from camssf.documents.document import Document

LONGEST_WORD, LONGEST_NAME = 24, 14
"""Only longer words may be broken at the end of a line; the second limit is for words with a digit, `_`, `/` or `\\`,
such as hashes and file names."""

_UNSHOWN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def clean(text: object) -> str:
    """Text without control, surrogate and direction-changing characters; not yet escaped."""
    return _UNSHOWN.sub("\ufffd", str(text))


def finalize(value: object) -> object:
    """Clean every text that a template writes; Markup is made by our own code and passes unchanged."""
    return value if isinstance(value, Markup) or not isinstance(value, str) else clean(value)


def words(text: object) -> Markup:
    """The text with a mark on very long words, so that only these may be broken."""
    if isinstance(text, Markup):
        return text
    parts = re.split(r"(\s+)", clean(text))
    return Markup("").join(
        Markup('<span class="long">{}</span>').format(part) if _long(part) else escape(part) for part in parts
    )


def _long(word: str) -> bool:
    return len(word) > LONGEST_WORD or (len(word) > LONGEST_NAME and re.search(r"[\d_/\\]", word) is not None)


def number(value: float, digits: int = 3) -> Markup:
    """A number with significant digits and a true minus sign; powers of ten only for very small or large numbers."""
    if value == 0:
        return Markup("0")
    if 1e-4 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return Markup(f"{value:.{decimals}f}".replace("-", "\u2212"))
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return Markup(f"{mantissa} × 10<sup>{int(exponent)}</sup>".replace("-", "\u2212"))


def brief(value: float) -> Markup:
    """A chosen number, such as a bound, without trailing zeros."""
    text = number(value)
    return Markup(text.rstrip("0").rstrip(".")) if "." in text and "<" not in text else text


def signed(value: float) -> str:
    """A number with its sign and at most one decimal."""
    text = f"{value:+.1f}" if abs(value) < 1e4 else f"{value:+.0e}"
    text = text.replace("-", "\u2212")
    return "0.0" if text[1:] == "0.0" else text


def percent(share: float) -> str:
    """A probability; closer than 0.001 to 0 or 1 it is given as a bound."""
    return "< 0.1 %" if share < 1e-3 else "> 99.9 %" if share > 0.999 else f"{100 * share:.1f} %"


def camera_name(document: Document) -> str:
    """Make and model; the make is not repeated."""
    photos = () if document.capture is None else document.capture.photos
    return named(photos[0].make, photos[0].model) if photos else named("", "")


def named(make: str, model: str) -> str:
    """A camera's make and model; the make is not repeated."""
    make, model = make.strip(), model.strip()
    # "NIKON CORPORATION" "NIKON D5100": many makers repeat their name in the model.
    twice = make and model.lower().startswith(make.lower().split()[0])
    return (model if twice else f"{make} {model}".strip()) or "unnamed camera"
