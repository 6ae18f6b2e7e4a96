"""README and docs are true: commands parse, links lead somewhere, tables agree with the code."""

import json
import os
import re
import subprocess
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import camssf
from camssf import Result
from camssf.cli import BATCH_FAILED, BUG, INTERRUPTED, UNDECIDED, app, main
from camssf.error_codes import codes
from camssf.errors import CalibrationError
from tests.support.pages import DOCS, PAGES, PROJECT, ROOT, blocks, calls, pins, text_of
from tools import cli_options

README = text_of("README.md")
CLI = typer.main.get_command(app)

pytestmark = pytest.mark.repository


def epilogs() -> list[str]:
    commands = CLI.commands.values()  # type: ignore[attr-defined]
    return [str(command.epilog).removeprefix("Example: ") for command in commands]


def written() -> list[str]:
    lines = [line for page in PAGES for block in blocks(page.read_text("utf-8"), "sh") for line in block.splitlines()]
    return [line for line in [*lines, *epilogs()] if calls(line)]


@pytest.mark.requirement("R-DOCS")
def test_every_written_command_is_one() -> None:
    """Parsed by the command line itself, which knows every option and its type; nothing is run."""
    for line in sorted(set(written())):
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


def test_every_command_has_one_example_of_itself() -> None:
    for name, command in CLI.commands.items():  # type: ignore[attr-defined]
        assert str(command.epilog).count("Example:") == 1
        assert [name] in [arguments[:1] for arguments in calls(command.epilog.removeprefix("Example: "))]


def test_the_readme_s_two_commands_make_their_own_environment() -> None:
    lines = [line for block in blocks(README, "sh") for line in block.splitlines() if "venv" in line]
    assert [line.rpartition("&& ")[2] for line in lines] == [
        ".venv/bin/camssf demo -o out/",
        ".venv/bin/python -m pytest",
    ]
    assert all(line.startswith("python3 -m venv .venv && .venv/bin/pip install -e ") for line in lines)


def test_there_is_one_way_to_install() -> None:
    """From a clone, since nothing is released; what will hold then stands once, on the page of installation."""
    folders = (ROOT / folder for folder in ("reference", "export", "tools", "benchmarks", "recipe", "golden"))
    kinds = (".py", ".js", ".html", ".json")
    sources = [path for folder in folders for path in folder.rglob("*") if path.suffix in kinds]
    texts = {path: path.read_text("utf-8") for path in [*PAGES, ROOT / "Dockerfile", *sources]}
    released = re.compile(r"camssf\[\w|(?:install|\+)[^\n]* git\+|--no-deps camssf")
    assert [path.name for path, text in texts.items() for _ in released.findall(text)] == ["install.md"]
    asked = {extra for text in texts.values() for extra in re.findall(r"pip install -e '\.\[([\w,-]+)\]'", text)}
    known = PROJECT["project"]["optional-dependencies"]
    assert {name for names in asked for name in names.split(",")} <= set(known)
    page = text_of("docs/install.md")
    assert set(re.findall(r"`([\w-]+)`", "".join(re.findall(r"^\| (`[^|]*) \|", page, re.MULTILINE)))) == set(known)


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
    parts = dict(re.findall(r"^\*\*`camssf ([\w -]+)`\*\*\n\n((?:\|.*\n?)+)", cli_options.tables(), re.MULTILINE))
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


def errors(kind: type[CalibrationError] = CalibrationError) -> Iterator[type[CalibrationError]]:
    """An error and all below it."""
    yield kind
    for below in kind.__subclasses__():
        yield from errors(below)


def test_pages_tell_the_exit_status_of_a_code_as_it_is() -> None:
    """Where a sentence names both, as `passport_invalid` and exit status 10."""
    count = 0
    for page in PAGES:
        for sentence in re.split(r"[.\n]\s", page.read_text("utf-8")):
            codes = {kind.exit_status for kind in errors() if f"`{kind.code}`" in sentence}
            statuses = {int(word) for word in re.findall(r"exit status(?: is)? (\d+)", sentence)}
            if codes and statuses:
                count += 1
                assert statuses <= codes, (page.name, sentence)
    assert count >= 3


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


def test_the_pages_need_no_other_server() -> None:
    text = text_of("mkdocs.yml")
    assert "font: false" in text
    settings = yaml.safe_load(text)
    assert [next(iter(each)) if isinstance(each, dict) else each for each in settings["plugins"]] == [
        "search",
        "mkdocstrings",
    ]
    for place in (*settings["extra_javascript"], *settings["extra_css"]):
        assert (ROOT / "docs" / place).is_file(), place
    for path in (ROOT / "docs" / "assets").rglob("*.css"):
        for place in re.findall(r"url\(([^)]+)\)", path.read_text("utf-8")):
            assert (path.parent / place).is_file(), place


@pytest.mark.full
def test_each_version_keeps_its_pages(tmp_path: Path) -> None:
    """As the nox session `site` deploys, with the theme and settings of ours, on one page."""
    pytest.importorskip("mike", reason="mike is not installed: no versions of the documentation")
    programs = sysconfig.get_path("scripts")  # mike calls mkdocs by its name
    quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "PATH": os.pathsep.join((programs, os.environ["PATH"]))}
    settings = yaml.safe_load(text_of("mkdocs.yml"))
    kept = {key: settings[key] for key in ("site_name", "theme", "extra", "strict")}
    (tmp_path / "mkdocs.yml").write_text(yaml.safe_dump(kept), "utf-8")
    (tmp_path / "docs").mkdir()

    def told(*command: str) -> str:
        done = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True, env=quiet)
        return done.stdout

    told("git", "init", "-q")
    told("git", "config", "user.name", "nobody")
    told("git", "config", "user.email", "nobody@example.org")
    told("git", "commit", "-q", "--allow-empty", "-m", "the release")
    for version in ("0.1", "0.2"):
        (tmp_path / "docs" / "index.md").write_text(f"# Of {version}\n", "utf-8")
        told(str(Path(programs) / "mike"), "deploy", "--alias-type=redirect", "--update-aliases", version, "latest")
    listed = json.loads(told("git", "show", "gh-pages:versions.json"))
    assert [(each["version"], each["aliases"]) for each in listed] == [("0.2", ["latest"]), ("0.1", [])]
    for version in ("0.1", "0.2"):
        page = told("git", "show", f"gh-pages:{version}/index.html")
        assert f"Of {version}" in page
        assert '"provider": "mike"' in page  # the page's head offers the others
    assert "../0.2/" in told("git", "show", "gh-pages:latest/index.html")


def test_ci_runs_the_readme_s_commands_before_it_pins_anything() -> None:
    text = text_of(".ci/run")
    assert len(re.findall(r"grep -m 1 .* README\.md", text)) == 2
    places = [text.index(word) for word in (
        "unset PIP_CONSTRAINT", 'run "demo"', 'run "tests"', "export PIP_CONSTRAINT", "-W error"
    )]  # fmt: skip
    assert places == sorted(places)
    # what the README's lines install is all that is in their environment
    assert not [line for line in text.splitlines() if ".venv" in line and not line.startswith("#")]
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111


def test_constraints_pin_what_the_package_asks_for() -> None:
    extras, asked = PROJECT["project"]["optional-dependencies"], PROJECT["project"]["dependencies"]
    asked = [*asked, *extras["test"], *extras["dev"], *PROJECT["build-system"]["requires"]]
    for requirement in (each for each in map(Requirement, asked) if each.name != "camssf"):
        assert requirement.specifier.contains(pins()[canonicalize_name(requirement.name)]), requirement
    assert not {name for name in pins() if name.startswith(("torch", "nvidia", "cuda"))}


def test_sizes_are_told_as_they_are() -> None:
    """Of what travels in an app: the models, tables and rules. (The code's size: ShrunkJarTest, after R8.)"""
    data = Path(camssf.__file__).parent / "data"
    tables = [data / f"{name}.json" for name in ("spectra", "rules", "messages", "forms", "colour", "finder")]
    models = [data / "bases.f64", data / "picture-spaces.json", *data.glob("*.onnx")]
    size = sum(path.stat().st_size for path in [*models, *tables] if path.name != "camssf-gaussian.onnx")
    android = text_of("docs/android.md")
    (most,) = re.findall(r"At most ([\d.]+) MB of models, tables and rules", android)
    assert float(most) * 0.9 < size / 1e6 <= float(most)


CITED = re.compile(r"docs/([a-z-]+)\.md")
TITLE = re.compile(r'docs/([a-z-]+)\.md, ((?:"[^"\n]+(?:\n[^"\n]*)?"(?:, | and )?)+)')
RULES = re.compile(
    r"rules? (\d+)(?: to (\d+)|(?:(?:, \d+)* and \d+))? of docs/([a-z-]+)\.md|docs/([a-z-]+)\.md, rule (\d+)", re.I
)
PYTHON_NAME = re.compile(r"(?<![.\w])camssf(?:_[a-z]+)?(?:\.[a-z_]+)+\b")


def sources() -> list[tuple[Path, str]]:
    """The text of every source file, with comments' line breaks taken out."""
    paths = [*ROOT.glob("reference/**/*.py"), *ROOT.glob("export/**/*.py")]
    paths += ROOT.glob("android-bindings/*/src/main/**/*.kt")
    return [(path, re.sub(r"\n[ \t]*(?:\*(?!/)|//|#)?[ \t]*", " ", path.read_text("utf-8"))) for path in paths]


def cited_in(text: str) -> list[tuple[str, str]]:
    """The pages that a text cites, each with how the cited line begins: nothing, a heading, a rule's number."""
    lines = [(page, "") for page in CITED.findall(text)]
    for page, titles in TITLE.findall(text):
        lines += [(page, f"# {title}") for title in re.findall('"(.*?)"', titles)]
    for first, last, page, other, number in RULES.findall(text):
        lines += [(page or other, f"{rule}.") for rule in (first or number, last) if rule]
    return lines


def test_what_docstrings_cite_exists() -> None:
    """Pages, headings and numbered rules of docs/."""
    missing, cited = [], 0
    for path, text in sources():
        for page, start in cited_in(text):
            cited += 1
            file = ROOT / "docs" / f"{page}.md"
            lines = file.read_text("utf-8").splitlines() if file.is_file() else []
            plain = [re.sub("^#+", "#", line.strip("*")) for line in lines]
            if not (start in plain if start.startswith("#") else any(line.startswith(start) for line in plain)):
                missing.append(f"{path.name}: docs/{page}.md {start}")
    assert cited > 60
    assert missing == []


def test_python_s_modules_that_kotlin_names_exist() -> None:
    missing = []
    for path in ROOT.glob("android-bindings/*/src/main/**/*.kt"):
        for name in PYTHON_NAME.findall(path.read_text("utf-8")):
            place = ROOT / "reference" / name.replace(".", "/")
            module = next((p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()), None)
            parents = [p for p in (place.parent.with_suffix(".py"), place.parent / "__init__.py") if p.is_file()]
            if module is None and not any(re.search(rf"\b{place.name}\b", p.read_text("utf-8")) for p in parents):
                missing.append(f"{path.name}: {name}")
    assert missing == []
