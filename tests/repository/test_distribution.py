"""What is given away: the container; the rest is shown by `python -m tools.release`."""

import re

import pytest
from packaging.specifiers import SpecifierSet

from tests.support.pages import PROJECT, ROOT, text_of

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
