"""The habits hold: markers, required tools, what CI runs, the files that strangers look for."""

import json
import re

import pytest
import yaml

from camssf import __version__
from tests.support.pages import PROJECT, ROOT, text_of
from tools.mutants import mutants

PYTHONS = ["3.11", "3.12", "3.13"]

pytestmark = pytest.mark.repository


def test_one_list_of_pythons() -> None:
    classifiers = PROJECT["project"]["classifiers"]
    assert [c.rpartition(":: ")[2] for c in classifiers if "Python :: 3." in c] == PYTHONS
    assert f"PYTHONS = {json.dumps(PYTHONS)}" in text_of("noxfile.py")
    assert PROJECT["project"]["requires-python"] == f">={PYTHONS[0]}"


def test_the_citation_is_whole() -> None:
    citation = yaml.safe_load(text_of("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["version"] == __version__ == PROJECT["project"]["version"]
    assert citation["license"] == PROJECT["project"]["license"]
    (paper,) = citation["references"]
    assert re.fullmatch(r"10\.\d{4}/\S+", paper["doi"])


def test_the_table_of_mutants_is_one_of_todays_code() -> None:
    """`python -m tools.mutants` runs them, in a quarter of an hour."""
    table = mutants()
    for mutant in table:
        assert mutant.text(ROOT) != (ROOT / mutant.file).read_text("utf-8")
        assert all((ROOT / test.partition("::")[0]).is_file() for test in mutant.tests.split()), mutant.what
    assert len({mutant.what for mutant in table}) == len(table)
