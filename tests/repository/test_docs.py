"""README and docs are true: commands parse, links lead somewhere, tables agree with the code."""

import re
from pathlib import Path

import pytest
import typer
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from camssf import Result
from camssf.cli import BATCH_FAILED, BUG, INTERRUPTED, UNDECIDED, app, main
from camssf.error_codes import codes
from tests.support.pages import DOCS, PAGES, PROJECT, ROOT, blocks, calls, pins, text_of
from tools import site_pages

README = text_of("README.md")
CLI = typer.main.get_command(app)

pytestmark = pytest.mark.repository


@pytest.mark.requirement("R-DOCS")
def test_every_written_command_is_one() -> None:
    """Parsed by the command line itself, which knows every option and its type; nothing is run."""
    lines = {line for page in PAGES for block in blocks(page.read_text("utf-8"), "sh") for line in block.splitlines()}
    commands = CLI.commands.values()  # type: ignore[attr-defined]
    for line in sorted(lines | {str(command.epilog).removeprefix("Example: ") for command in commands}):
        for arguments in calls(line):
            try:
                parse(arguments)
            except Exception as error:
                raise AssertionError(line) from error


def parse(arguments: list[str]) -> None:
    """A command of a command, as `passport sign`, likewise."""
    group, rest = CLI, arguments
    while isinstance(group, typer.core.TyperGroup) and rest:
        name, *rest = rest
        group = group.commands[name]
    group.make_context(" ".join(arguments), list(rest))


def test_the_readme_s_two_commands_make_their_own_environment() -> None:
    lines = [line for block in blocks(README, "sh") for line in block.splitlines() if "venv" in line]
    assert [line.rpartition("&& ")[2] for line in lines] == [
        ".venv/bin/camssf demo -o out/",
        ".venv/bin/python -m pytest",
    ]
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install -e ") for line in lines)


@pytest.mark.requirement("R-DOCS")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("https://", "mailto:")):
            continue
        name, _, anchor = target.partition("#")
        aim = (page.parent / name).resolve() if name else page
        if aim.suffix == ".png" and not aim.exists():
            pytest.fail(f"{target}: run `camssf demo -o out/` and copy out/ssf.png there")
        assert aim.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", aim.read_text("utf-8"), re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}
            assert anchor in anchors, target


@pytest.mark.requirement("R-DOCS")
def test_files_named_in_backticks_exist_and_no_place_of_one_machine_is_named() -> None:
    for page in PAGES:
        text = page.read_text("utf-8")
        for name in re.findall(r"`((?:tests|docs|reference|export|golden|benchmarks|\.ci)/[\w./-]+)`", text):
            assert (ROOT / name).exists(), (page.name, name)
        assert not re.search(r"(?<![\w.])/(work|tmp|home|root|Users)/", text), page.name


def test_the_readme_is_short() -> None:
    assert len(README.split()) <= 700


def test_cli_md_names_every_command_and_the_site_its_options() -> None:
    text = text_of("docs/cli.md")
    parts = dict(re.findall(r"^\*\*`camssf ([\w -]+)`\*\*\n\n((?:\|.*\n?)+)", site_pages.options(), re.MULTILINE))
    for name, command in CLI.commands.items():  # type: ignore[attr-defined]
        assert f"`{name}`" in text or f"`camssf {name}`" in text
        for parameter in [] if isinstance(command, typer.core.TyperGroup) else command.params:
            for option in parameter.opts if parameter.param_type_name == "option" else []:
                assert option == "--help" or option in parts[name], (name, option)
    assert "passport sign" in parts


@pytest.mark.full
def test_the_lamp_s_numbers_are_what_the_page_s_commands_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = text_of("docs/accuracy.md")
    (block,) = [block for block in blocks(text, "sh") if "--lamp equal-energy" in block]
    shoot, *fits = [arguments for line in block.splitlines() for arguments in calls(line)]
    rows = re.findall(r"\| `(\w+)` \| ([\w-]+), (?:wrong|right) \| ([\d. ]+) \| ([\d. ]+) \|", text)
    assert len(rows) == len(fits) == 2
    monkeypatch.chdir(tmp_path)
    assert main(shoot) == 0
    for basis, lamp, rmsre, rmse in rows:
        (fit,) = [arguments for arguments in fits if lamp in arguments]
        assert basis in fit
        assert main(fit) == 0
        scores = Result.load(Path(fit[-1], "result.json")).scores
        # as printed; two per cent leave room for another OpenCV or NumPy
        assert [float(v) for v in rmsre.split()] == pytest.approx(scores.rmsre_percent, rel=0.02, abs=0.006)
        assert [float(v) for v in rmse.split()] == pytest.approx(scores.rmse, rel=0.02, abs=6e-5)
    capsys.readouterr()
    (wrong,) = [arguments for arguments in fits if "equal-energy" in arguments]
    at = wrong.index("--basis")
    assert main(wrong[:at] + wrong[at + 2 :]) == 6
    assert "lamp_unfit" in "".join(capsys.readouterr())


@pytest.mark.requirement("R-DOCS")
def test_cli_md_has_the_exit_statuses_of_no_code() -> None:
    """Those of codes are on the site's page of errors, from the classes."""
    text = text_of("docs/cli.md").partition("## Exit status")[2]
    rows = {int(status) for status in re.findall(r"^\| (\d+) \|", text, re.M)}
    assert rows == {0, BATCH_FAILED, UNDECIDED, BUG, INTERRUPTED}


def test_every_page_is_in_the_navigation() -> None:
    listed = set(re.findall(r": ([\w/-]+\.md)$", text_of("mkdocs.yml"), re.MULTILINE))
    stored = {page.relative_to(ROOT / "docs").as_posix() for page in DOCS}
    assert listed == stored | {f"errors/{code}.md" for code in codes()}


def test_constraints_pin_what_the_package_asks_for() -> None:
    extras, asked = PROJECT["project"]["optional-dependencies"], PROJECT["project"]["dependencies"]
    asked = [*asked, *extras["test"], *extras["dev"], *PROJECT["build-system"]["requires"]]
    for requirement in (each for each in map(Requirement, asked) if each.name != "camssf"):
        assert requirement.specifier.contains(pins()[canonicalize_name(requirement.name)]), requirement
    assert not {name for name in pins() if name.startswith(("torch", "nvidia", "cuda"))}
