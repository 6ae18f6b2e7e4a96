"""Every public name is in the reference, with its words and an example that runs."""

import ast
import doctest
import re
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import get_origin

import pytest

from tests.support.pages import DOCS, ROOT, blocks
from tools.site_pages import names_in, public_names, with_names

ROOMS = (
    "camssf", "camssf.spectra", "camssf.recovery", "camssf_colour", "camssf.exports", "camssf_lab.direct",
    "camssf_fleet",
)  # fmt: skip
NO_EXAMPLE = {"divide", "extract", "FrameSpectrum", "Progress"} | {"Passport", "verify", "read_public"}
"""A spectrograph's frames are too long to make on a page: test_direct.py makes them. A passport needs a signer:
the one of docs/passport.md is an example."""
TEXTS = [page.read_text("utf-8") for page in (ROOT / "docs" / "reference").glob("*.md") if page.stem != "index"]
PAGES = {text.partition("\n")[0].removeprefix("# "): text for text in TEXTS}
WITH_DOCTESTS = ("camssf.spectra.lamps", "camssf.spectra.charts", "camssf.spectra.cameras", "camssf.error_codes")


def public() -> list[str]:
    return [f"{room}.{name}" for room in (*ROOMS, "camssf.errors") for name in public_names(room)]


@pytest.mark.repository
def test_every_public_name_is_in_the_reference_with_an_example() -> None:
    for room in ROOMS:
        assert set(public_names(room)) <= names_in(PAGES[room]) | NO_EXAMPLE, room
    listed = [name for page in PAGES.values() for name in re.findall(r"^::: (\S+)$", with_names(page), re.MULTILINE)]
    assert sorted(listed) == sorted(public())


@pytest.mark.repository
def test_pages_import_public_names_only() -> None:
    rooms = {*ROOMS, "camssf.errors"}
    for page in (ROOT / "README.md", *DOCS):
        for block in blocks(page.read_text("utf-8"), "python"):
            for node in ast.walk(ast.parse(block)):
                if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0].startswith("camssf"):
                    private = {name.name for name in node.names if f"{node.module}.{name.name}" not in public()}
                    assert node.module in rooms, (page.name, node.module)
                    assert not private, (page.name, node.module, private)


@pytest.mark.repository
def test_every_public_name_says_what_it_is() -> None:
    """Functions name what they raise where they raise; classes their attributes."""
    for name in public():
        room, _, word = name.rpartition(".")
        found = getattr(import_module(room), word)
        if not isinstance(found, type) and (not callable(found) or get_origin(found)):
            continue  # a type alias or a constant: its words stand below it in the source
        assert found.__doc__, name
        if isinstance(found, type) and is_dataclass(found) and not issubclass(found, Exception):
            for field in fields(found):
                assert re.search(rf"\b{field.name}\b", found.__doc__), f"{name}.{field.name}"


@pytest.mark.parametrize("module", WITH_DOCTESTS)
def test_the_docstrings_examples_run(module: str) -> None:
    failed, tried = doctest.testmod(import_module(module))
    assert tried
    assert not failed
