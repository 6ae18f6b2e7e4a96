"""The habits hold: markers, required tools, what CI runs, the files that strangers look for."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

import pytest
import yaml
from packaging.utils import canonicalize_name

from camssf import __version__

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
PYTHONS = ["3.11", "3.12", "3.13"]


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


# -- required tools -----------------------------------------------------------------------------------------------

SKIPS = {
    "passes": "def test(): pass",
    "skips": "import pytest\ndef test(): pytest.skip('no Frobnicator on this machine')",
    "whole_file": "import pytest\npytest.skip('Frobnicator is missing', allow_module_level=True)",
    "import": "import pytest\npytest.importorskip('frobnicator', exc_type=ImportError)",
    "fixture": "import pytest\n@pytest.fixture\ndef f(): pytest.skip('frobnicator')\ndef test(f): pass",
    "mark": "import pytest\n@pytest.mark.skipif(True, reason='no frobnicator')\ndef test(): pass",
    "other": "import pytest\ndef test(): pytest.skip('not on this system')",
}
NO_FAULT = ("passes", "other")


def inner(folder: Path, names: Iterable[str], require: str | None) -> tuple[int, str]:
    """The exit status and output of these test files under this project's conftest."""
    folder.mkdir()
    (folder / "conftest.py").write_text((ROOT / "tests" / "conftest.py").read_text("utf-8"), encoding="utf-8")
    for name in names:
        (folder / f"test_{name}.py").write_text(SKIPS[name] + "\n", encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = numerical\n", encoding="utf-8")
    environment = {
        name: value for name, value in os.environ.items() if name not in ("CAMSSF_REQUIRE", "PYTEST_ADDOPTS")
    }
    environment |= {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"} | ({} if require is None else {"CAMSSF_REQUIRE": require})
    package = folder / "lib" / "frobnicator" / "__init__.py"  # it is there, but broken
    package.parent.mkdir(parents=True)
    package.write_text("raise ImportError('broken')\n", encoding="utf-8")
    environment["PYTHONPATH"] = str(folder / "lib")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)],
        capture_output=True, text=True, env=environment, cwd=folder, timeout=120,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


@pytest.mark.full
def test_a_skip_for_want_of_a_required_tool_fails_the_run(tmp_path: Path) -> None:
    status, said = inner(tmp_path / "all", SKIPS, "frobnicator")
    assert status == 1, said
    for name in SKIPS:
        (fault,) = [*re.findall(rf"^ERROR: \S*test_{name}\.py\S* skipped, but .*$", said, re.M), ""][:1]
        assert ("frobnicator is required" in fault) == (name not in NO_FAULT), said
    status, said = inner(tmp_path / "sound", NO_FAULT, "frobnicator")
    assert status == 0, said
    status, said = inner(tmp_path / "nothing_required", [*NO_FAULT, "skips"], None)
    assert status == 0, said
    assert "2 skipped" in said


def test_a_required_tool_that_is_not_there_stops_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    conftest = load(ROOT / "tests" / "conftest.py")
    monkeypatch.setenv("CAMSSF_REQUIRE", "pytest nosuchtool")
    with pytest.raises(pytest.UsageError, match="nosuchtool"):
        conftest.pytest_configure(None)
    monkeypatch.setenv("CAMSSF_REQUIRE", "pytest")
    conftest.pytest_configure(None)
    assert conftest.forbidden("no JVM, no jar", ["java", "gpg"]) == ["java"]
    assert conftest.forbidden("not on this system", ["java", "gpg"]) == []


def test_every_skip_names_its_tool_as_the_variable_does() -> None:
    """The reasons in the sources, beside what .ci/run requires."""
    conftest = load(ROOT / "tests" / "conftest.py")
    said = "\n".join(path.read_text("utf-8") for path in (ROOT / "tests").glob("test_*.py") if path != Path(__file__))
    assert {"java", "chromium", "strace", "imagecodecs", "cvxpy"} <= set(required_by_ci())
    for tool in ("java", "chromium", "imagecodecs", "cvxpy"):
        reasons = re.findall(r"""(?:skip\(\s*f?|reason=)["']([^"']+)["']""", said)
        assert [reason for reason in reasons if tool in conftest.forbidden(reason, [tool])], tool


def required_by_ci() -> list[str]:
    first, more = re.findall(r'^export CAMSSF_REQUIRE="([^"]+)"$', (ROOT / ".ci" / "run").read_text("utf-8"), re.M)
    assert more.split()[0] == "$CAMSSF_REQUIRE"  # what the first run requires, the second does, too
    return [*first.split(), *more.split()[1:]]


# -- markers ------------------------------------------------------------------------------------------------------


def test_the_numerical_files_exist() -> None:
    conftest = load(ROOT / "tests" / "conftest.py")
    assert {path.stem for path in (ROOT / "tests").glob("test_*.py")} >= conftest.NUMERICAL


def test_markers_are_registered_and_strict() -> None:
    options = PROJECT["tool"]["pytest"]["ini_options"]
    assert "--strict-markers" in options["addopts"]
    assert {line.partition(":")[0] for line in options["markers"]} == {"full", "numerical", "requirement(name)"}


# -- other processors ---------------------------------------------------------------------------------------------


def test_what_did_not_take_effect_is_seen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kernels = load(ROOT / ".ci" / "kernels.py")
    own = kernels.Force(("Haswell",), ("X86_V3", "X86_V4", "AVX512_ICL"))
    made = kernels.variants(own)
    assert made["NumPy without AVX-512"] == {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"}
    assert made["NumPy without AVX-512 and AVX2"] == {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL X86_V3"}
    assert {"OPENBLAS_CORETYPE": "Prescott"} in made.values()
    monkeypatch.setattr(kernels.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(kernels, "run", lambda variant, extra: [])
    monkeypatch.setattr(kernels, "probe", lambda extra: own)  # nothing that is asked for is done
    assert kernels.main([]) == 1
    said = capsys.readouterr().out
    assert "NumPy without AVX-512 took no effect" in said
    assert "only 1 of at least 3 variants differ" in said

    def obedient(extra: dict[str, str]) -> object:
        off = extra.get("NPY_DISABLE_CPU_FEATURES", "").split()
        core = {"Prescott": "Katmai"}.get(extra.get("OPENBLAS_CORETYPE", ""), "Haswell")
        return kernels.Force((core,), tuple(name for name in own.numpy if name not in off))

    monkeypatch.setattr(kernels, "probe", obedient)
    assert kernels.main([]) == 0
    said = capsys.readouterr().out
    assert "OPENBLAS_CORETYPE=Zen: OpenBLAS Haswell; NumPy X86_V3 X86_V4 AVX512_ICL, the same as 'as it is'" in said
    assert "kernels: 4 variants, 0 failed" in said
    monkeypatch.setattr(kernels, "run", lambda variant, extra: ["golden"] if extra.get("OPENBLAS_CORETYPE") else [])
    assert kernels.main([]) == 1
    assert "OPENBLAS_CORETYPE=Prescott: golden" in capsys.readouterr().out


def test_a_processor_without_avx512_has_nothing_to_switch_off() -> None:
    kernels = load(ROOT / ".ci" / "kernels.py")
    made = kernels.variants(kernels.Force(("Haswell",), ("X86_V3",)))
    assert made["NumPy without AVX-512"] == {}
    assert made["NumPy without AVX-512 and AVX2"] == {"NPY_DISABLE_CPU_FEATURES": "X86_V3"}
    assert not [extra for extra in made.values() if extra.get("OPENBLAS_CORETYPE") == "SkylakeX"]


# -- what strangers look for --------------------------------------------------------------------------------------


def test_the_workflow_runs_ci_and_every_python() -> None:
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text("utf-8"))
    jobs = workflow["jobs"]
    assert set(workflow) == {"name", True, "permissions", "concurrency", "jobs"}  # YAML 1.1 reads "on" as true
    assert workflow["permissions"] == {"contents": "read"}
    assert "bash .ci/run" in [step.get("run") for step in jobs["everything"]["steps"]]
    assert jobs["everything"]["runs-on"].startswith("ubuntu-")
    matrix = jobs["python"]["strategy"]["matrix"]
    assert matrix["python"] == PYTHONS
    assert {system.partition("-")[0] for system in matrix["os"]} == {"ubuntu", "macos", "windows"}
    said = "\n".join(step.get("run", "") for step in jobs["python"]["steps"])
    for line in ("python -m pytest", "ruff check .", "ruff format --check ."):
        assert line in said.splitlines()
    assert "-e '.[test]'" in said


def test_one_list_of_pythons() -> None:
    classifiers = PROJECT["project"]["classifiers"]
    assert [c.rpartition(":: ")[2] for c in classifiers if "Python :: 3." in c] == PYTHONS
    assert f"PYTHONS = {json.dumps(PYTHONS)}" in (ROOT / "noxfile.py").read_text("utf-8")
    assert PROJECT["project"]["requires-python"] == f">={PYTHONS[0]}"


def test_the_hooks_come_from_pypi_in_the_pinned_versions() -> None:
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))
    assert [repository["repo"] for repository in hooks["repos"]] == ["local"]
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if "==" in line and not line.startswith("#"))
    pins = {canonicalize_name(name): version for name, version in pins.items()}
    for hook in hooks["repos"][0]["hooks"]:
        assert hook["language"] == "python", hook["id"]
        for word in hook["additional_dependencies"]:
            name, _, version = word.partition("==")
            assert version == pins[canonicalize_name(name)], word


def test_the_citation_is_whole() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["version"] == __version__ == PROJECT["project"]["version"]
    assert citation["license"] == PROJECT["project"]["license"]
    (paper,) = citation["references"]
    assert re.fullmatch(r"10\.\d{4}/\S+", paper["doi"])


def test_issue_forms_are_forms() -> None:
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        form = yaml.safe_load(path.read_text("utf-8"))
        if path.stem == "config":
            assert form["blank_issues_enabled"] is False
            continue
        assert {"name", "description", "body"} <= set(form), path.name
        identifiers = [field["id"] for field in form["body"] if field["type"] != "markdown"]
        assert identifiers, path.name
        assert len(set(identifiers)) == len(identifiers), path.name
        for field in form["body"]:
            assert field["type"] in {"markdown", "textarea", "input", "dropdown", "checkboxes"}, path.name
            assert field["attributes"].get("label") or field["attributes"].get("value"), path.name
