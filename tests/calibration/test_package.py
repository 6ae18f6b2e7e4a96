"""The package as a whole: light to import, its public names pinned; progress that is told; without extras."""

import ast
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from itertools import pairwise
from pathlib import Path

import pytest

import camssf
from camssf import cli, errors
from camssf.calibration import solve
from camssf.errors import BY_CODE, CalibrationError
from camssf.photo.capture import measure
from camssf.photo.shot import Shot
from camssf.progress import Progress, part_of
from tests.support.captures import photos

REFERENCE = Path(camssf.__file__).parents[1]
PACKAGES = ("camssf", "camssf_app", "camssf_colour", "camssf_fleet", "camssf_lab")
MOST_PARAMETERS = 8
MOST_LINES = 450
HEAVY = (
    "cv2", "rawpy", "colour", "torch", "onnx", "onnxruntime", "matplotlib", "tifffile", "rich", "typer",
    "cryptography", "joserfc", "bcrypt", "duckdb", "upath", "fsspec", "dask", "distributed",
    "jinja2", "pandas", "xarray",
)  # fmt: skip
FILES = sorted(path.relative_to(REFERENCE) for each in PACKAGES for path in (REFERENCE / each).rglob("*.py"))
Reports = list[tuple[str, float]]
STAGES = [file for file in FILES if not {"cli", "cli.py", "__main__.py"} & set(file.parts)]


def stderr_of(code: str, *words: str, cwd: Path | None = None) -> str:
    """What a new interpreter, which ends well, writes to stderr."""
    call = [sys.executable, "-c", code, *words]
    done = subprocess.run(call, cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stderr


FRESH = """
import json, sys

def loaded(*names):
    return sorted({name.partition(".")[0] for name in sys.modules} & set(names))

heavy, stages = json.loads(sys.argv[1])
found = {}
import camssf
found["import camssf"] = loaded(*heavy)
from camssf import calibrate
found["import calibrate"] = loaded("numpy", *heavy)
from camssf.cli import main
main(["calibrate", "--help"])
found["help"] = loaded("numpy", "scipy", "colour", "matplotlib", "cv2", "onnxruntime")
shown = loaded(*heavy)
from camssf.spectra import chart_names, lamp_names, read_chart, read_lamp
for name in [*lamp_names(), "2856K", "D:5500"]:
    read_lamp(name)
for name in chart_names():
    read_chart(name)
found["lamps and charts by name"] = loaded("colour", "scipy", "matplotlib")
for turn in range(2):  # Python puts a submodule in the place of a function of the same name
    for name in camssf.__all__:
        assert callable(getattr(camssf, name)) or name == "WAVELENGTHS", (turn, name)
from camssf import calibrate, validate
assert callable(calibrate) and callable(validate)
for stage in stages:
    __import__(stage)
found["all stages"] = sorted(set(loaded(*heavy)) - set(shown))
print(json.dumps(found), file=sys.stderr)
"""


@pytest.mark.full
@pytest.mark.requirement("R-ROOMS")
def test_what_a_new_interpreter_loads() -> None:
    """One interpreter: the package, `calibrate`, a help, lamps and charts by name, public names, every stage."""
    stages = [".".join(file.with_suffix("").parts).removesuffix(".__init__") for file in STAGES]
    assert json.loads(stderr_of(FRESH, json.dumps([HEAVY, stages]))) == {
        "import camssf": [], "import calibrate": [], "help": [], "lamps and charts by name": [], "all stages": [],
    }  # fmt: skip


def test_version_is_the_package_s() -> None:
    if not any(metadata.distributions(name="camssf")):
        pytest.skip("camssf is not installed here, only on the path: no version to compare with")
    assert camssf.__version__ == metadata.version("camssf")


def test_typed() -> None:
    assert all((REFERENCE / package / "py.typed").is_file() for package in PACKAGES)


def test_each_error_has_one_code_and_one_exit_status() -> None:
    named = [kind.code for kind in vars(errors).values() if isinstance(kind, type) and "code" in vars(kind)]
    assert sorted(named) == sorted([*BY_CODE, CalibrationError.code])
    families = CalibrationError.__subclasses__()
    assert len({family.exit_status for family in families}) == len(families)
    for family in families:
        assert {kind.exit_status for kind in BY_CODE.values() if issubclass(kind, family)} == {family.exit_status}
    assert all(kind.__name__ in str(errors.__doc__) and code in str(errors.__doc__) for code, kind in BY_CODE.items())


def public_functions(body: list[ast.stmt], inside: str = "") -> Iterator[tuple[str, int]]:
    """Name and number of parameters, self left out, of functions and of the methods of public classes."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node.body, f"{node.name}.")
        elif isinstance(node, ast.FunctionDef) and (not node.name.startswith("_") or node.name == "__init__"):
            given = [each.arg for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            yield inside + node.name, len([name for name in given if not inside or name not in ("self", "cls")])


@pytest.mark.repository
def test_one_file_one_product_and_few_parameters() -> None:
    """What must be said together is a product of its own, as `Options`; a command's parameters are its options."""
    for file in FILES:
        text = (REFERENCE / file).read_text("utf-8")
        assert file.name == "__init__.py" or len(text.splitlines()) <= MOST_LINES, file
        functions = [] if "cli" in file.with_suffix("").parts else public_functions(ast.parse(text).body)
        assert not [name for name, count in functions if count > MOST_PARAMETERS], file


@pytest.fixture
def photo() -> Path:
    return Path(str(photos(camera="Demo phone").shots[0].chart))


def check(reports: Reports) -> None:
    parts = [part for _, part in reports]
    assert (parts[0], parts[-1], parts) == (0.0, 1.0, sorted(parts)), reports
    assert len(reports) > 2
    assert max(late - early for early, late in pairwise(parts)) <= 0.65, reports


def into(reports: Reports) -> Progress:
    return lambda stage, part: reports.append((stage, part))


def test_measuring_and_solving_tell_from_0_to_1(photo: Path) -> None:
    measured, solved = Reports(), Reports()
    solve(measure(Shot(photo, "D55"), progress=into(measured)), progress=into(solved))
    check(measured)
    check(solved)


def test_a_part_of_the_whole() -> None:
    reports: Reports = []
    part_of(into(reports), 0.2, 0.6)("solving", 0.5)
    part_of(part_of(into(reports), 0.5, 1.0), 0.5, 1.0)("validating", 1.0)
    part_of(None, 0.0, 1.0)("nothing", 0.0)
    assert reports == [("solving", pytest.approx(0.4)), ("validating", 1.0)]


SAID = """
import json, sys
from camssf.cli import main, terminal
said = []
def call(bar, stage, part):
    said.append((stage, part, "numpy" in sys.modules or "camssf.calibration" in sys.modules))
    raise SystemExit(0)
terminal._Bar.__call__ = call
for line in ("calibrate chart.dng --lamp D55", "batch none.csv", "demo -o out"):
    try:
        main(line.split())
    except SystemExit:
        pass
print(json.dumps(said), file=sys.stderr)
"""


def test_a_command_begins_to_tell_before_it_loads_anything(tmp_path: Path) -> None:
    """Each command ends at its first word."""
    assert json.loads(stderr_of(SAID, cwd=tmp_path)) == [["starting", 0.0, False]] * 3


@pytest.mark.full
def test_a_command_tells_from_0_to_1(photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reports = Reports()
    monkeypatch.setattr(cli.terminal._Bar, "__call__", lambda bar, stage, part: reports.append((stage, part)))
    monkeypatch.chdir(tmp_path)
    for words in (f"calibrate {photo} --lamp D55 -o out", "report out/result.json -o again"):
        assert cli.main(words.split()) == 0
        check(reports)
        reports.clear()


PLAIN_RUN = """
import contextlib, io, os, sys
sys.modules |= dict.fromkeys(("colour", "colour_cxf", "matplotlib", "pandas", "xarray"))  # None: not installed
from camssf import Result
from camssf.cli import main
from camssf.errors import InvalidArgument

assert main("calibrate chart.dng --lamp D55 --white white.dng --basis cameras -o out --truth truth.csv".split()) == 0
assert set(os.listdir("out")) == {"result.json", "ssf.csv", "patches.csv", "ssf.svg", "report.html"}
with contextlib.redirect_stderr(io.StringIO()) as err:
    assert main("calibrate chart.dng --lamp D55 --chart chart.cxf".split()) == 2
assert 'pip install -e ".[cxf]"' in err.getvalue()
assert main("simulate --lamp D55 --size 900x675 -o simulated".split()) == 0
result = Result.load("out/result.json")
assert "<svg" in result._repr_html_()
for ask in (result.plot, result.to_pandas, result.to_xarray, result.to_colour):
    try:
        ask()
    except InvalidArgument as error:
        assert "pip install" in error.advice
    else:
        raise AssertionError(ask)
"""


@pytest.mark.full
def test_without_the_dropped_libraries_it_calibrates_and_says_what_is_missing(tmp_path: Path) -> None:
    made = photos()
    for path in (made.shots[0].chart, made.shots[0].white, made.truth):
        shutil.copy(str(path), tmp_path)
    cxf = '<?xml version="1.0"?><CxF xmlns="http://colorexchangeformat.com/CxF3-core"/>'
    (tmp_path / "chart.cxf").write_text(cxf)
    stderr_of(PLAIN_RUN, cwd=tmp_path)
