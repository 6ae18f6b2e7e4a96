"""What holds for every test: which are numerical, and which tools a run may not lack.

A test that lacks a tool skips and says which, so that a stranger's clone passes. Where the tool was installed on
purpose, as `.ci/run` does, such a skip means that something was not checked and nobody noticed. So
CAMSSF_REQUIRE="java chromium strace imagecodecs" makes the run fail if one of these is not there, or if any test
skips with a reason that names it.
"""

import gc
import importlib.util
import os
import re
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import typer.main

from tests.support.browser import NAMES, Browser

# Small matrices: on a busy machine several threads only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# `camssf.cli.main` makes the tree of commands at each call; it holds no state, and tests call it hundreds of times.
typer.main.get_command = cache(typer.main.get_command)

NUMERICAL = {
    "test_arrays",
    "test_basis",
    "test_choice",
    "test_dense_model",
    "test_direct",
    "test_families",
    "test_layers",
    "test_onnx",
    "test_ssf",
    "test_code",
    "test_validate",
    "test_verdict",
}
"""Files whose tests get the marker `numerical`: their last bits depend on the linear algebra underneath.

Those marked `full` show the same as the others, and get it only where it stands beside `full`. The cases of
test_golden.py are made anew, on the same linear algebra, by `python -m golden.generate --check`.
"""
COMMANDS = {
    "java": ("java",),
    "gpg": ("gpg",),
    "strace": ("strace",),
    "exiftool": ("exiftool",),
    "rawtherapee": ("rawtherapee-cli",),
    "chromium": NAMES,
}
"""Required tools that are programs, by any of these names; others are files or Python packages."""
FILES = {"axe": "CAMSSF_AXE", "spectacle": "CAMSSF_SPECTACLE"}
"""Required tools that are single files, by the variable that says where one lies."""
WORDS = {"java": ("java", "no jar", "jvm"), "spectacle": ("pyspectacle",)}
"""Words by which a skip's reason names a tool, where they are not its name."""


def required() -> list[str]:
    return os.environ.get("CAMSSF_REQUIRE", "").split()


def there(tool: str) -> bool:
    if tool in COMMANDS:
        return any(map(shutil.which, COMMANDS[tool]))
    if tool in FILES:
        return Path(os.environ.get(FILES[tool], "")).is_file()
    return importlib.util.find_spec(tool) is not None


def forbidden(reason: str, tools: list[str]) -> list[str]:
    """Which of the tools a skip's reason names."""
    return [
        tool for tool in tools if any(re.search(rf"\b{word}\b", reason.lower()) for word in WORDS.get(tool, (tool,)))
    ]


def pytest_configure(config: pytest.Config) -> None:
    if missing := [tool for tool in required() if not there(tool)]:
        raise pytest.UsageError(f"CAMSSF_REQUIRE names what is not there: {', '.join(missing)}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.stem in NUMERICAL and not item.get_closest_marker("full"):
            item.add_marker(pytest.mark.numerical)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> object:
    """Sockets that a test with such libraries leaves open warn in that test, not in the next one.

    A socket that the garbage collector closes warns in whatever test runs then, and under `-W error` fails it.
    """
    done = yield
    if any(mark.args == ("default",) for mark in item.iter_markers("filterwarnings")):
        gc.collect()
    return done


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> object:
    """A forbidden skip turns a passed run into a failed one; so does one of a whole file, at its import.

    The names of tests that warned go into the file that CAMSSF_WARNED names.
    """
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter and "CAMSSF_WARNED" in os.environ:
        warned = sorted({report.nodeid for report in reporter.stats.get("warnings", []) if report.nodeid})
        Path(os.environ["CAMSSF_WARNED"]).write_text("".join(f"{name}\n" for name in warned), "utf-8")
    for report in reporter.stats.get("skipped", []) if reporter else []:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if tools := forbidden(reason, required()):
            where = report.nodeid or Path(report.longrepr[0]).name
            reporter.write_line(f"\nERROR: {where} skipped, but {', '.join(tools)} is required: {reason}", red=True)
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
    return (yield)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One for all tests of a file; each opens a tab of its own."""
    running = Browser(tmp_path_factory.mktemp("browser") / "profile")
    yield running
    running.close()
