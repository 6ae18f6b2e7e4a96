"""The package as a whole: light to import, its public names pinned, its stages in order."""

import ast
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import camssf

PACKAGE = Path(camssf.__file__).parent
FLOORS = (
    {"version", "errors", "grid"},
    {"files", "rules", "libraries"},
    {"places", "fonts"},
    {"spectra", "error_codes"},
    {"recovery"},
    {"options", "learning"},
    {"photo"},
    {"fit", "colour", "direct", "simulation"},
    {"verdict"},
    {"documents"},
    {"report", "exports"},
    {"result"},
    {"calibration"},
    {"compare", "fleet", "app"},
    {"cli"},
)
"""A module may import from its own room and from lower floors only; docs/architecture.md draws it."""
ROOMS = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
MOST_PARAMETERS = 8
MANY_PARAMETERS: set[str] = set()
"""Functions not yet mended: the list only shrinks. Commands of cli are exempt: their parameters are the options."""
MOST_FIELDS = 8
MANY_FIELDS = {
    "photo.capture.Photo": "the tags of a file, a row of the documents",
    "photo.read.dng.Mosaic": "samples and tags of a file, as it states them",
    "photo.read.gain_maps.GainMap": "the fields of a DNG opcode",
    "photo.read.pieces.Picture": "the tags of a TIFF's layout",
    "recovery.covariance.LinearisedSignals": "the columns of one table of rows",
    "recovery.linear_model._Folded": "the observation's arrays, folded onto the nodes",
    "recovery.observation.Observation": "the inputs of the model, by their names",
    "recovery.pivoting._Walk": "the tableau of a pivoting walk",
}
"""Products of the mathematics and of the photo that have more fields, and why: the list only shrinks."""
MOST_LINES = 450
LONG: set[str] = set()
"""Files not yet divided: the list only shrinks."""
SMALL_LETTERS: set[str] = set()
"""Files whose messages do not all begin like sentences yet: the list only shrinks."""
HEAVY = (
    "cv2", "rawpy", "colour", "torch", "onnx", "onnxruntime", "matplotlib", "tifffile", "rich", "typer",
    "cryptography", "duckdb", "deltalake", "arro3", "upath", "fsspec", "dask", "distributed",
    "jinja2", "pandas", "xarray",
)  # fmt: skip
MODULES = sorted(
    path.relative_to(PACKAGE).with_suffix("").as_posix().replace("/", ".").removesuffix(".__init__")
    for path in PACKAGE.rglob("*.py")
)
STAGES = [name for name in MODULES if name.partition(".")[0] in ROOMS and name.partition(".")[0] != "cli"]
RETIRED = {
    "asked", "told", "said", "known", "beside", "seen", "taken", "lit", "settled", "believed", "how", "evidence",
    "suspects", "sensing",
}  # fmt: skip
"""Words of an earlier private language; none may be the name of a parameter or a product's attribute."""
RETIRED_IN = {"fleet.rows.Row.evidence"}
"""Where one is right: here the marginal likelihood."""


FRESH = """
import json, sys

def loaded(*names):
    return sorted({name.partition(".")[0] for name in sys.modules} & set(names))

heavy, stages = json.loads(sys.argv[1])
found = {}
import camssf
found["import camssf"] = loaded(*heavy)
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
        assert callable(getattr(camssf, name)), (turn, name)
from camssf import calibrate, validate
assert callable(calibrate) and callable(validate)
for stage in stages:
    __import__("camssf." + stage)
found["all stages"] = sorted(set(loaded(*heavy)) - set(shown))
print(json.dumps(found), file=sys.stderr)
"""


@pytest.mark.requirement("R-ROOMS")
def test_what_a_new_interpreter_loads() -> None:
    """One interpreter, in this order: the package, a help, lamps and charts by name, public names, every stage."""
    done = subprocess.run(
        [sys.executable, "-c", FRESH, json.dumps([HEAVY, STAGES])], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stderr) == {
        "import camssf": [], "help": [], "lamps and charts by name": [], "all stages": [],
    }  # fmt: skip


def test_no_stage_loads_anything_heavy() -> None:
    """At its top, by reading it."""
    for stage in STAGES:
        assert not {name.partition(".")[0] for name, top in imports(stage) if top} & set(HEAVY), stage


def test_public_names() -> None:
    assert camssf.__all__ == [
        "Calibration",
        "CalibrationError",
        "Observation",
        "Options",
        "Result",
        "Shot",
        "calibrate",
        "find_chart",
        "measure_patches",
        "normalise",
        "read_dng",
        "recover",
        "validate",
    ]
    assert dir(camssf) == sorted([*camssf.__all__, "__version__"])


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'recovr'"):
        _ = camssf.recovr


def test_version_is_the_package_s() -> None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        installed = version("camssf")
    except PackageNotFoundError:
        pytest.skip("camssf is not installed here, only on the path: no version to compare with")
    assert camssf.__version__ == installed


@cache
def imports(stage: str, *, typed: bool = False) -> list[tuple[str, bool]]:
    """(module, at the top?) of every import of a stage; those for type checkers only where `typed`."""
    found: list[tuple[str, bool]] = []

    def visit(node: ast.AST, top: bool) -> None:
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) and not typed:
            return
        if isinstance(node, ast.Import):
            found.extend((alias.name, top) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{stage}: relative import"
            if node.module == "camssf":
                found.extend((f"camssf.{alias.name}", top) for alias in node.names)
            else:
                found.append((node.module or "", top))
        elif isinstance(node, ast.stmt | ast.Module | ast.excepthandler | ast.match_case):
            top = top and not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            for part in ast.iter_child_nodes(node):
                visit(part, top)

    visit(tree(stage), True)
    return found


@cache
def own(module: str) -> set[str]:
    """The package's own modules that one imports: at its top, lazily, or for type checkers only."""
    known = set(MODULES)
    found = imports(module, typed=True)
    names = {name.removeprefix("camssf.") for name, _ in found if name.startswith("camssf.")}
    return {name if name in known else name.rpartition(".")[0] for name in names} - {""}


@pytest.mark.requirement("R-ROOMS")
def test_a_room_knows_only_lower_floors() -> None:
    for module in MODULES:
        room = module.partition(".")[0]
        if room not in ROOMS:
            continue
        others = {name.partition(".")[0] for name in own(module)} - {room}
        assert not [other for other in others if ROOMS[other] >= ROOMS[room]], f"{module} reaches up or sideways"
        assert not [
            name for name, _ in imports(module) if name.partition(".")[0] in ("camssf_onnx", "golden", "tests")
        ]


@pytest.mark.requirement("R-ROOMS")
def test_photo_and_recovery_do_not_know_each_other() -> None:
    for module in MODULES:
        room = module.partition(".")[0]
        if other := {"photo": "recovery", "recovery": "photo"}.get(room):
            assert other not in {name.partition(".")[0] for name in own(module)}, module


def test_no_module_reaches_itself() -> None:
    known = {module: own(module) for module in MODULES if not module.startswith("__")}
    for module in known:
        reached, new = set[str](), known[module]
        while new:
            reached |= new
            new = {further for name in new for further in known.get(name, ())} - reached
        assert module not in reached, f"{module} is in a cycle"


def test_every_module_is_in_a_room() -> None:
    assert {name.partition(".")[0] for name in MODULES} - set(ROOMS) == {"__init__", "__main__"}


def test_typed() -> None:
    assert (PACKAGE / "py.typed").is_file()


def test_each_error_has_one_code_and_one_exit_status() -> None:
    errors = import_module("camssf.errors")
    kinds = [errors.CalibrationError]
    for kind in kinds:
        kinds.extend(kind.__subclasses__())
    leaves = [kind for kind in kinds if not kind.__subclasses__()]
    assert sorted(kind.code for kind in leaves) == sorted(
        [
            "unreadable_raw",
            "unsupported_raw",
            "not_sensor_raw",
            "camera_unusual",
            "chart_not_found",
            "overexposed",
            "underexposed",
            "uneven_light",
            "frames_differ",
            "unit_differs",
            "blurred",
            "glare",
            "lamp_unfit",
            "chart_unfit",
            "not_converged",
            "colour_out_of_reach",
            "passport_invalid",
            "out_of_memory",
            "invalid_argument",
        ]
    )
    families = errors.CalibrationError.__subclasses__()
    assert len({family.exit_status for family in families}) == len(families)
    for family in families:
        assert all(kind.exit_status == family.exit_status for kind in family.__subclasses__())
    assert all(kind.__name__ in errors.__doc__ and kind.code in errors.__doc__ for kind in leaves)


@cache
def tree(module: str) -> ast.Module:
    path = PACKAGE / module.replace(".", "/")
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(path.read_text("utf-8"))


def public_functions(body: list[ast.stmt], inside: str = "") -> Iterator[tuple[str, int]]:
    """Name and number of parameters, self left out, of functions and of the methods of public classes."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node.body, f"{node.name}.")
        elif isinstance(node, ast.FunctionDef) and (not node.name.startswith("_") or node.name == "__init__"):
            given = [each.arg for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            yield inside + node.name, len([name for name in given if not inside or name not in ("self", "cls")])


def test_few_parameters() -> None:
    """What must be said together is a product of its own, as `Options`."""
    found = {
        f"{module}.{name}"
        for module in MODULES
        if module.partition(".")[0] != "cli"
        for name, count in public_functions(tree(module).body)
        if count > MOST_PARAMETERS
    }
    assert found == MANY_PARAMETERS


def fields_of(node: ast.ClassDef) -> int:
    """Number of fields of a dataclass; 0 for other classes."""
    if not any("dataclass" in ast.unparse(each) for each in node.decorator_list):
        return 0
    return sum(isinstance(each, ast.AnnAssign) and "ClassVar" not in ast.unparse(each) for each in node.body)


def test_products_are_small() -> None:
    """More belongs into parts, as `Ssf` has its posterior, proof, light and settings."""
    found = {
        f"{module}.{node.name}"
        for module in MODULES
        if module.partition(".")[0] in ("photo", "recovery", "fit", "verdict", "options")
        for node in ast.walk(tree(module))
        if isinstance(node, ast.ClassDef) and fields_of(node) > MOST_FIELDS
    }
    assert found == set(MANY_FIELDS)


def test_one_file_one_product() -> None:
    lines = {
        module: len((PACKAGE / f"{module.replace('.', '/')}.py").read_text("utf-8").splitlines())
        for module in MODULES
        if not (PACKAGE / module.replace(".", "/")).is_dir()
    }
    assert {module for module, count in lines.items() if count > MOST_LINES} == LONG


def test_messages_begin_like_sentences() -> None:
    """With a capital letter, a number, or the name of what they are about."""
    errors = import_module("camssf.errors")
    kinds = {name for name, kind in vars(errors).items() if isinstance(kind, type) and hasattr(kind, "exit_status")}
    found = set()
    for module in MODULES:
        for node in ast.walk(tree(module)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in kinds and node.args:
                first = node.args[0].values[0] if isinstance(node.args[0], ast.JoinedStr) else node.args[0]
                text = str(first.value) if isinstance(first, ast.Constant) else ""
                if text[:1].islower() and not text.startswith("camssf "):
                    found.add(module)
    assert found == SMALL_LETTERS


def test_nothing_but_the_two_packages_is_importable() -> None:
    """What the wheel packs is what lies in these folders."""
    folders = (PACKAGE.parent, PACKAGE.parents[1] / "export")
    found = {
        path.name
        for folder in folders
        for path in folder.iterdir()
        if (path / "__init__.py").is_file() or path.suffix == ".py"
    }
    assert found == {"camssf", "camssf_onnx"}


def test_no_class_name_twice() -> None:
    found = Counter(
        node.name for module in MODULES for node in ast.walk(tree(module)) if isinstance(node, ast.ClassDef)
    )
    assert not {name: count for name, count in found.items() if count > 1}


def test_no_retired_word_in_a_signature() -> None:
    found = set()
    for module in MODULES:
        for node in ast.walk(tree(module)):
            if isinstance(node, ast.FunctionDef):
                given = {each.arg for each in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)}
                if node.args.kwarg:
                    given.add(node.args.kwarg.arg)
                found |= {f"{module}.{node.name}.{word}" for word in given & RETIRED}
            elif isinstance(node, ast.ClassDef):
                fields = {
                    each.target.id
                    for each in node.body
                    if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
                }
                found |= {f"{module}.{node.name}.{word}" for word in fields & RETIRED}
    assert found == RETIRED_IN
