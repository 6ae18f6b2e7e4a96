"""The package as a whole: light to import, its public names pinned, its stages in order."""

import ast
import json
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

import camssf

PACKAGE = Path(camssf.__file__).parent
ORDER = [
    "errors",
    "grid",
    "spectra",
    "mosaic",
    "chart",
    "patches",
    "signals",
    "basis",
    "sensing",
    "unrolled",
    "ssf",
    "verdict",
    "validate",
    "report",
    "capture",
    "calibrate",
    "simulate",
    "faults",
    "batch",
    "cli",
]
HEAVY = ("cv2", "rawpy", "colour", "torch", "onnx", "onnxruntime", "matplotlib", "tifffile", "rich", "typer")
BESIDE = {"direct", "dispersion", "engine", "families", "files", "fonts", "learn", "parity", "tabulate"}
"""Public modules beside the line of stages."""


def fresh(code: str) -> str:
    """What a new interpreter prints; the environment carries PYTHONPATH on."""
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    ).stdout


def test_import_is_light() -> None:
    # numpy first, so that only what camssf adds is measured; best of several, for busy machines
    code = (
        "import numpy, time, sys; t = time.perf_counter(); import camssf; d = time.perf_counter() - t;"
        "import json; print(json.dumps([d, sorted(sys.modules)]))"
    )
    runs = [json.loads(fresh(code)) for _ in range(3)]
    assert min(seconds for seconds, _ in runs) < 0.3
    loaded = {name.partition(".")[0] for name in runs[0][1]}
    assert not loaded & set(HEAVY)


@pytest.mark.parametrize("stage", ORDER[:-1])
def test_a_stage_loads_nothing_heavy(stage: str) -> None:
    """At its top, by reading it: one interpreter for each would take a minute."""
    assert not {name.partition(".")[0] for name, top in imports(stage) if top} & set(HEAVY)


def test_every_stage_together_loads_nothing_heavy() -> None:
    code = (
        f"import importlib, json, sys\nfor s in {ORDER[:-1]!r}: importlib.import_module('camssf.' + s)\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    assert not {name.partition(".")[0] for name in json.loads(fresh(code))} & set(HEAVY)


def test_public_names() -> None:
    assert camssf.__all__ == [
        "CalibrationError",
        "calibrate",
        "find_chart",
        "measure_patches",
        "normalise",
        "read_dng",
        "recover",
        "validate",
    ]
    assert dir(camssf) == sorted([*camssf.__all__, "__version__"])


def test_public_names_are_verbs_however_they_are_reached() -> None:
    """Python puts a submodule in the place of a function of the same name: calibrate, validate."""
    code = (
        "import camssf, types\n"
        "for turn in range(2):\n"
        "    for name in camssf.__all__:\n"
        "        value = getattr(camssf, name)\n"
        "        assert callable(value) and not isinstance(value, types.ModuleType), (turn, name, value)\n"
        "from camssf import calibrate, validate\n"
        "assert callable(calibrate) and callable(validate)\n"
    )
    fresh(code)
    fresh("import camssf.calibrate, camssf.validate\n" + code)


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
def imports(stage: str) -> list[tuple[str, bool]]:
    """(module, at the top?) of every import of a stage, TYPE_CHECKING blocks left out."""
    tree = ast.parse((PACKAGE / f"{stage}.py").read_text("utf-8"))
    typing_only = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and "TYPE_CHECKING" in ast.unparse(block.test)
        for node in ast.walk(block)
    }
    lazy = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
    }
    found = []
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            found += [(alias.name, id(node) not in lazy) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{stage}: relative import"
            if node.module == "camssf":
                found += [(f"camssf.{alias.name}", id(node) not in lazy) for alias in node.names]
            else:
                found.append((node.module or "", id(node) not in lazy))
    return found


@pytest.mark.parametrize("stage", ORDER)
def test_a_stage_imports_only_stages_to_its_left(stage: str) -> None:
    left = ORDER[: ORDER.index(stage)]
    own = {name.split(".")[1] for name, _ in imports(stage) if name.startswith("camssf.")}
    assert own & set(ORDER) <= set(left), f"{stage} reaches to its right"
    assert not [name for name, _ in imports(stage) if name.partition(".")[0] in ("camssf_onnx", "golden", "tests")]


def test_only_the_joiners_join() -> None:
    """capture joins the stages up to the patch means, calibrate the rest; a stage knows few."""
    known = {stage: {n for n, _ in imports(stage) if n.startswith("camssf.")} for stage in ORDER}
    joiner = min(len(known["capture"]), len(known["calibrate"]))
    assert all(len(known[stage]) < joiner for stage in ORDER[: ORDER.index("capture")])


def test_the_order_names_every_module() -> None:
    present = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}
    assert set(ORDER) <= present
    assert {name for name in present - set(ORDER) if not name.startswith("_")} <= BESIDE


def test_a_private_module_belongs_to_one_stage_and_reaches_no_further() -> None:
    for path in PACKAGE.glob("_[a-z]*.py"):
        owners = [stage for stage in ORDER if f"camssf.{path.stem}" in {name for name, _ in imports(stage)}]
        assert len(owners) == 1, f"{path.name} is used by {owners}"
        own = {name.split(".")[1] for name, _ in imports(path.stem) if name.startswith("camssf.")}
        assert own & set(ORDER) <= set(ORDER[: ORDER.index(owners[0])]), path.name


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
            "chart_not_found",
            "overexposed",
            "underexposed",
            "uneven_light",
            "frames_differ",
            "blurred",
            "glare",
            "lamp_unfit",
            "chart_unfit",
            "not_converged",
            "invalid_argument",
        ]
    )
    families = errors.CalibrationError.__subclasses__()
    assert len({family.exit_status for family in families}) == len(families)
    for family in families:
        assert all(kind.exit_status == family.exit_status for kind in family.__subclasses__())
    assert all(kind.__name__ in errors.__doc__ and kind.code in errors.__doc__ for kind in leaves)


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
