"""What is given away: the wheel in an empty environment, the container, the conda recipe, shell completion."""

from __future__ import annotations

import ast
import hashlib
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jinja2
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from camssf.version import __version__
from tests.support.pages import PROJECT, ROOT, text_of
from tools import conda_recipe
from tools.tutorials import TUTORIALS, blocks, outputs

DOCKERFILE = text_of("Dockerfile")


def copied(stage: str) -> list[str]:
    """What a stage of the Dockerfile copies out of the checkout."""
    lines = [line.split()[1:-1] for line in stage.splitlines() if line.startswith("COPY ")]
    return [name for names in lines for name in names if not names[0].startswith("--from")]


BUILD, RUN = DOCKERFILE.split("\n\n", 1)


# -- the wheel -------------------------------------------------------------------------------------------------------


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """A command's output; no module of this checkout is on its path."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run([str(word) for word in command], cwd=cwd, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built of nothing but the files that the Dockerfile copies."""
    pip = [sys.executable, "-m", "pip"]
    fetch = [*pip, "download", "-q", "--no-deps", "-d", str(tmp_path_factory.mktemp("index")), "hatchling"]
    if any(subprocess.run(call, capture_output=True).returncode for call in ([*pip, "--version"], fetch)):
        pytest.skip("no pip, or no package index is reached: the wheel is not tried")
    source = tmp_path_factory.mktemp("source")
    for name in copied(BUILD):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, source)
    folder = tmp_path_factory.mktemp("wheels")
    run(*pip, "wheel", "-q", "--no-deps", "--wheel-dir", folder, source)
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The bin of an environment that holds the wheel and what it needs; 600 MB, removed afterwards."""
    if "CAMSSF_FRESH" not in os.environ:
        pytest.skip("installs from a package index for minutes: set CAMSSF_FRESH=1")
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", folder)
    binaries = folder / ("Scripts" if os.name == "nt" else "bin")
    what = f"{wheel}[{EXTRA}]"
    run(binaries / "python", "-m", "pip", "install", "-q", "--constraint", ROOT / "constraints.txt", what)
    yield binaries
    shutil.rmtree(folder)


@pytest.mark.full
@pytest.mark.requirement("R-RELEASE")
def test_the_wheel_holds_every_file_of_the_packages_and_nothing_else(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
        (metadata,) = [archive.read(name).decode() for name in archive.namelist() if name.endswith("/METADATA")]
        licences = {Path(name).name for name in archive.namelist() if "/licenses/" in name}
    folders = (*(ROOT / "reference").glob("camssf*"), ROOT / "export")
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc"]
    assert packed == {path.relative_to(ROOT).as_posix().split("/", 1)[1] for path in files}
    assert licences == {"LICENSE", "NOTICE"}
    assert len(re.findall(r"^Project-URL: \w+, https://", metadata, re.MULTILINE)) == len(PROJECT["project"]["urls"])


@pytest.mark.full
@pytest.mark.requirement("R-RELEASE")
def test_the_wheel_works_in_an_empty_environment(environment: Path, tmp_path: Path) -> None:
    assert run(environment / "camssf", "--version", cwd=tmp_path) == f"camssf {__version__}\n"
    where = run(environment / "python", "-c", "import camssf; print(camssf.__file__)", cwd=tmp_path).strip()
    assert Path(where).is_relative_to(environment.parent)
    run(environment / "camssf", "demo", "-o", "out", cwd=tmp_path)
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000
    again = run(environment / "camssf", "validate", "out/result.json", "--truth", "out/shots/truth.csv", cwd=tmp_path)
    assert 0 < max(yaml.safe_load(again)["scores"]["rmse"]) < 0.1


# -- the tutorials in an empty environment --------------------------------------------------------------------------

EXTRA = "notebook"
"""What the first tutorial installs in addition to the package."""


@pytest.mark.repository
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_needs_nothing_but_what_it_installs(page: Path) -> None:
    """Its imports and commands; the test below runs it, which installs for minutes."""
    install = re.findall(r"pip install -e '\.\[(.*)\]'", text_of("docs/tutorials/first-phone.md"))
    assert install == [EXTRA]
    extras = PROJECT["project"]["optional-dependencies"]
    needs = [*PROJECT["project"]["dependencies"], *extras[EXTRA], *extras["plot"]]
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


@pytest.mark.full
@pytest.mark.requirement("R-RELEASE")
@pytest.mark.skipif(os.name == "nt", reason="the pages' commands are for a POSIX shell")
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_a_tutorial_runs_in_an_empty_environment(environment: Path, page: Path, tmp_path: Path) -> None:
    """Block by block in a folder that holds nothing, by the wheel alone; a page's Python is one process."""
    printed = outputs(page.read_text("utf-8"), tmp_path, str(environment / "python"), str(environment))
    assert "nan" not in " ".join(printed).split()
    assert list(tmp_path.iterdir())


# -- the container and the conda recipe ------------------------------------------------------------------------------


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


def rendered(text: str) -> dict[str, Any]:
    """A recipe as conda reads it."""
    return dict(yaml.safe_load(jinja2.Template(text).render(PYTHON="python")))


@pytest.mark.repository
def test_the_recipe_needs_what_pyproject_needs() -> None:
    assert conda_recipe.main(["--check"]) == 0, "run python -m tools.conda_recipe"
    found = rendered(conda_recipe.PAGE.read_text("utf-8"))
    assert found["package"] == {"name": "camssf", "version": __version__}
    needs = {name: bound for name, _, bound in (line.partition(" ") for line in found["requirements"]["run"])}
    assert needs.pop("python") == PROJECT["project"]["requires-python"]
    ours = {each.name: str(each.specifier) for each in map(Requirement, PROJECT["project"]["dependencies"])}
    assert needs.pop("py-opencv") in ours.pop("opencv-python-headless")
    assert needs == ours
    (line,) = found["build"]["entry_points"]
    assert line == f"camssf = {PROJECT['project']['scripts']['camssf']}"


@pytest.mark.repository
def test_the_recipe_of_a_release_names_its_file_by_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conda_recipe, "PAGE", tmp_path / "meta.yaml")
    assert conda_recipe.main(["--check"]) == 1
    (tmp_path / "sdist.tar.gz").write_bytes(b"x")
    assert conda_recipe.main(["--sdist", str(tmp_path / "sdist.tar.gz")]) == 0
    source = rendered(conda_recipe.PAGE.read_text("utf-8"))["source"]
    assert source["sha256"] == hashlib.sha256(b"x").hexdigest()
    assert source["url"].endswith(f"/camssf-{__version__}.tar.gz")


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
