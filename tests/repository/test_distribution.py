"""What is given away: what tutorials need, the container, completion; the rest: tools.release."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from tests.support.pages import PROJECT, ROOT, text_of
from tools import release
from tools.tutorials import TUTORIALS, blocks

DOCKERFILE = text_of("Dockerfile")


def copied(stage: str) -> list[str]:
    """What a stage of the Dockerfile copies out of the checkout."""
    lines = [line.split()[1:-1] for line in stage.splitlines() if line.startswith("COPY ")]
    return [name for names in lines for name in names if not names[0].startswith("--from")]


BUILD, RUN = DOCKERFILE.split("\n\n", 1)


# -- the tutorials ---------------------------------------------------------------------------------------------------


@pytest.mark.repository
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_needs_nothing_but_what_it_installs(page: Path) -> None:
    """Its imports and commands; tools.release runs the first in an empty environment."""
    install = re.findall(r"pip install -e '\.\[(.*)\]'", text_of("docs/tutorials/first-phone.md"))
    assert install == [release.EXTRA]
    extras = PROJECT["project"]["optional-dependencies"]
    needs = [*PROJECT["project"]["dependencies"], *extras[release.EXTRA], *extras["plot"]]
    ours = {"camssf", "camssf_colour", "camssf_fleet", "camssf_lab"}
    there = {Requirement(need).name for need in needs} | ours | sys.stdlib_module_names
    for kind, block, _ in blocks(page.read_text("utf-8")):
        if kind == "python":
            trees = [node for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Import | ast.ImportFrom)]
            for node in trees:
                names = [node.module] if isinstance(node, ast.ImportFrom) else [each.name for each in node.names]
                assert {str(name).partition(".")[0] for name in names} <= there, block
        else:
            assert kind == "sh"
            words = {line.split()[0] for line in block.splitlines() if line[:1].isalpha()}
            assert words <= {"camssf", "cat", "mkdir"}


# -- the container ---------------------------------------------------------------------------------------------------


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


# -- shell completion ------------------------------------------------------------------------------------------------


@pytest.mark.full
@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
@pytest.mark.parametrize(("words", "answers"), [
    ("camssf cal", {"calibrate"}), ("camssf calibrate --lamp", {"--lamp", "--lamp-tolerance"}),
    ("camssf passport s", {"sign", "show"}),
])  # fmt: skip
def test_bash_completes(words: str, answers: set[str], tmp_path: Path) -> None:
    """By the function that camssf prints for a shell, in a bash of its own."""
    shim = tmp_path / "camssf"
    shim.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m camssf "$@"\n')
    shim.chmod(0o755)
    given = words.split()
    script = (
        f'eval "$(_CAMSSF_COMPLETE=source_bash camssf)"; COMP_WORDS=({words}); COMP_CWORD={len(given) - 1}; '
        'function=$(complete -p camssf | sed "s/.*-F \\([^ ]*\\).*/\\1/"); $function camssf; '
        'printf "%s\\n" "${COMPREPLY[@]}"'
    )
    path = {"PATH": os.pathsep.join((str(tmp_path), os.environ["PATH"]))}
    how: Any = {"env": os.environ | path, "capture_output": True, "text": True}
    done = subprocess.run(["bash", "-c", script], check=True, **how)
    assert set(done.stdout.split()) == answers, done.stderr
