"""The habits hold: markers, data with their licences, the container, the files that strangers look for."""

import hashlib
import json
import re
import subprocess
from pathlib import Path

import pytest
import yaml
from packaging.specifiers import SpecifierSet

from camssf import __version__
from tests.support.pages import PROJECT, ROOT, text_of
from tools.mutants import mutants, with_fault

PYTHONS = ["3.11", "3.12", "3.13"]


@pytest.mark.repository
def test_one_list_of_pythons() -> None:
    classifiers = PROJECT["project"]["classifiers"]
    assert [c.rpartition(":: ")[2] for c in classifiers if "Python :: 3." in c] == PYTHONS
    assert f"PYTHONS = {json.dumps(PYTHONS)}" in text_of("noxfile.py")
    assert PROJECT["project"]["requires-python"] == f">={PYTHONS[0]}"


@pytest.mark.repository
def test_the_citation_is_whole() -> None:
    citation = yaml.safe_load(text_of("CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["version"] == __version__ == PROJECT["project"]["version"]
    assert citation["license"] == PROJECT["project"]["license"]
    (paper,) = citation["references"]
    assert re.fullmatch(r"10\.\d{4}/\S+", paper["doi"])


@pytest.mark.repository
def test_the_table_of_mutants_is_one_of_todays_code() -> None:
    """`python -m tools.mutants` runs them, in a quarter of an hour."""
    table = mutants()
    for mutant in table:
        assert with_fault(mutant) != (ROOT / mutant["file"]).read_text("utf-8")
        assert all((ROOT / test.partition("::")[0]).is_file() for test in mutant["tests"].split()), mutant["what"]
    assert len({mutant["what"] for mutant in table}) == len(table)


DATA = ROOT / "data"


def table() -> dict[str, list[str]]:
    """The rows of data/README.md: file → what, origin, licence, SHA-256."""
    lines = (DATA / "README.md").read_text("utf-8").splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if re.match(r"\| \w+/", line)]
    return {row[0]: row[1:] for row in rows}


@pytest.mark.repository
def test_every_file_is_described_and_none_has_changed() -> None:
    found = {
        path.relative_to(DATA).as_posix(): f"`{hashlib.sha256(path.read_bytes()).hexdigest()}`"
        for path in DATA.rglob("*")
        if path.is_file() and path != DATA / "README.md"
    }
    assert found == {name: row[3] for name, row in table().items()}


@pytest.mark.repository
def test_every_licence_allows_it_and_is_in_the_notice() -> None:
    notice = (ROOT / "NOTICE").read_text("utf-8")
    full = {
        "Apache-2.0": "Apache License, Version 2.0",
        "MIT": "MIT licence",
        "BSD-3-Clause": "BSD-3-Clause licence",
        "BSL-1.0": "Boost Software License 1.0\n----",
    }
    for name, (_, origin, licence, _) in table().items():
        assert origin, name
        assert full[licence] in notice, name


@pytest.mark.repository
def test_what_may_not_ship_is_not_here() -> None:
    """Nor in a file that git does not know; unlike `rglob`, git bears a folder that Maven removes meanwhile."""
    every = ["git", "ls-files", "-z", "--cached", "--others"]
    listed = subprocess.run(every, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\0")
    assert not {"phones.csv", "foreign.csv"} & {Path(name).name for name in listed}


DOCKERFILE = text_of("Dockerfile")


def copied(stage: str) -> list[str]:
    """What a stage of the Dockerfile copies out of the checkout."""
    lines = [line.split()[1:-1] for line in stage.splitlines() if line.startswith("COPY ")]
    return [name for names in lines for name in names if not names[0].startswith("--from")]


BUILD, RUN = DOCKERFILE.split("\n\n", 1)


@pytest.mark.repository
def test_the_dockerfile_copies_what_is_there_and_runs_as_a_user_without_rights() -> None:
    names = copied(BUILD) + copied(RUN)
    assert {"reference", "export", "pyproject.toml", "constraints.txt"} <= set(names)
    allowed = text_of(".dockerignore").splitlines()
    for name in names:
        assert (ROOT / name).exists(), name
        assert f"!{name}" in allowed, name
    assert {PROJECT["project"]["readme"], *PROJECT["project"]["license-files"]} <= set(copied(BUILD))
    (user,) = re.findall(r"^USER (\d+)$", RUN, re.MULTILINE)
    assert int(user) > 0
    (extras,) = re.findall(r'/wheels/\*\.whl\)\[([\w,]+)\]"', RUN)
    assert set(extras.split(",")) <= set(PROJECT["project"]["optional-dependencies"])
    for version in re.findall(r"^FROM python:([\d.]+)-slim", DOCKERFILE, re.MULTILINE):
        assert SpecifierSet(PROJECT["project"]["requires-python"]).contains(version)
        assert f"Programming Language :: Python :: {version}" in PROJECT["project"]["classifiers"]
