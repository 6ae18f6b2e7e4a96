"""The chores: `nox -s quick` while working, `nox -l` for all of them, `.ci/run` before a change goes in.

    nox -s quick                       the README's tests, three minutes
    nox -s quick -- tests/recovery/test_ssf.py  one stage's
    nox -s tests-3.13                  every test, on one Python
    nox -s benchmarks -- certify       one or more benchmarks, by name

Every session has its own environment with the versions of constraints.txt; `nox -R` uses it again as it is.
"""

from __future__ import annotations

from pathlib import Path

import nox

ROOT = Path(__file__).parent
PYTHONS = ["3.11", "3.12", "3.13"]

nox.options.sessions = ["quick", "lint", "types"]
nox.options.reuse_venv = "yes"
nox.options.error_on_missing_interpreters = False  # here; .github/workflows/ci.yml has all of them


def install(session: nox.Session, *what: str) -> None:
    """Pinned, from PyPI; without arguments camssf with all that its tests and tools need."""
    pinned = {"PIP_CONSTRAINT": str(ROOT / "constraints.txt"), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    session.install(*(what or ("-e", ".[dev]")), env=pinned)


@nox.session
def quick(session: nox.Session) -> None:
    """The README's tests."""
    install(session, "-e", ".[test]")
    session.run("python", "-m", "pytest", "-q", "-W", "error", *session.posargs)


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """Every test."""
    install(session)
    session.run("python", "-m", "pytest", "-W", "error", "-m", "full or not full", *session.posargs)


@nox.session
def lint(session: nox.Session) -> None:
    """Ruff: rules and form; `nox -s lint -- --fix` mends what it can."""
    install(session, "ruff")
    session.run("ruff", "check", ".", *session.posargs)
    session.run("ruff", "format", *([] if "--fix" in session.posargs else ["--check"]), ".")


@nox.session
def types(session: nox.Session) -> None:
    """mypy, strict, over the packages, golden and tools; import-linter's contracts."""
    install(session)
    session.run("mypy", *session.posargs)
    session.run("lint-imports")


@nox.session
def golden(session: nox.Session) -> None:
    """The golden vectors and the models are what the sources make; `nox -s golden -- write` makes them anew."""
    install(session)
    if "write" in session.posargs:
        session.run("python", "-m", "camssf_onnx", "build")
        session.run("python", "-m", "golden.generate")
    session.run("python", "-m", "golden.generate", "--check")
    session.run("python", "-m", "camssf_onnx", "check")


@nox.session
def kernels(session: nox.Session) -> None:
    """The numerical tests on an old processor's linear algebra."""
    install(session)
    session.run("python", ".ci/kernels.py")


@nox.session
def docs(session: nox.Session) -> None:
    """The documentation, strict; `nox -s docs -- serve` shows it in a browser."""
    install(session, "mkdocs-material", "mkdocstrings[python]")
    quiet = {"NO_MKDOCS_2_WARNING": "1"}
    session.run("mkdocs", *(session.posargs or ["build", "--strict", "--site-dir", session.create_tmp()]), env=quiet)


@nox.session
def site(session: nox.Session) -> None:
    """The documentation of a version beside those of the versions before: `nox -s site -- 1.2`.

    A commit on the local branch gh-pages, where `latest` leads to it and `mike serve` shows all; nothing is pushed.
    """
    if len(session.posargs) != 1:
        session.error("nox -s site -- X.Y, the version that this is the documentation of")
    install(session, "mike", "mkdocs-material", "mkdocstrings[python]")
    quiet = {"NO_MKDOCS_2_WARNING": "1"}
    session.run(
        "mike", "deploy", "--alias-type=redirect", "--update-aliases", session.posargs[0], "latest", env=quiet
    )
    session.run("mike", "set-default", "latest", env=quiet)


@nox.session(venv_backend="none")
def kotlin(session: nox.Session) -> None:
    """Everything in android-bindings; needs JDK 17 and Maven."""
    session.run("mvn", "-B", "-ntp", "-f", "android-bindings", "verify", *session.posargs, external=True)


@nox.session
def benchmarks(session: nox.Session) -> None:
    """Those that are named; without a name, the names."""
    install(session)
    for words in [[name] for name in session.posargs] or [[]]:
        session.run("python", "-m", "benchmarks", *words)
