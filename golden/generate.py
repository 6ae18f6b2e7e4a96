"""The only writer of golden/: `python -m golden.generate` writes, `--check` tests that nothing has drifted.

Both make everything in memory. A stored case stays as it is to the bit if the one made now has the same inputs and
limits, its outputs agree with the stored ones within the limits (another BLAS or CPU rounds differently), and the
stored oracle proves itself: its gap, computed anew, keeps its bound and one on rounding (`compare.blur`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from camssf.errors import CalibrationError
from camssf.files import write_file
from camssf.recovery.onnx_model import SHIPPED, load_model
from golden import forms
from golden.compare import METRICS, blur, optimality, rmse
from golden.contract import Stage
from golden.forms import ROOT, GoldenError, Json, digest, resolve
from golden.oracle import consult
from golden.reading import FORMAT, check, check_keys, generator_digest
from golden.running import judge, problem, run
from golden.stages import STAGES

ORACLE_GAP = 5e-10
"""Largest relative duality gap of the oracle's solution, apart from rounding (`Proof.bound`)."""
MARGIN = 0.9
"""At generation the RMSE against the truth must be below this fraction of its bound."""
DIGITS = 12
"""Significant digits stored for curves and bands; more precise than their limits of 1e-10."""
NUMBERS = ("outputs", "oracle", "truth")
COMMAND = "python -m golden.generate"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 0 on success, 1 if something drifted or violates a limit, 2 if cvxpy is missing."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Write the golden vectors, or check them.")
    parser.add_argument("--check", action="store_true", help="write nothing: make all anew and compare")
    parser.add_argument("case", nargs="*", help="write nothing: print what becomes of these, as verdict/haze")
    options = parser.parse_args(arguments)
    if find_spec("cvxpy") is None:
        print("cvxpy is missing: the oracle needs it. Install the extra dev.", file=sys.stderr)
        return 2
    try:
        scenes = _scenes()
        for name in options.case:
            if name not in scenes:
                raise GoldenError(f"there is no case {name}")
            tried = finish(scenes[name])
            stated = {key: value for key, value in (tried["outputs"] or {}).items() if key in ("status", "codes")}
            print(f"{name}: {tried['expect']}", stated or "")
        if options.case:
            return 0
        made = _files(scenes)
    except GoldenError as error:
        print(f"golden: {error}", file=sys.stderr)
        return 1
    finally:
        forms.PENDING.clear()
    known = [path for kind in ("cases/*/*.json", "manifest.json") for path in ROOT.glob(kind)]
    stored = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in known}
    changed = sorted(name for name in stored.keys() | made.keys() if stored.get(name) != made.get(name))
    for name in changed:
        if options.check:
            print(f"{name}: {_change(stored.get(name), made.get(name))}")
        elif name in made:
            (ROOT / name).parent.mkdir(parents=True, exist_ok=True)
            write_file(ROOT / name, made[name])
        else:
            (ROOT / name).unlink()
    print(f"{len(made)} files, {len(changed)} {'drifted' if options.check else 'written'}")
    if options.check and changed:
        print(f"If that is meant, run `{COMMAND}`.", file=sys.stderr)
    return 1 if options.check and changed else 0


def _change(stored: bytes | None, made: bytes | None) -> str:
    """What is different about a file, in words."""
    if stored is None or made is None:
        return "missing" if stored is None else "no row makes it"
    try:
        return ", ".join(drift(json.loads(stored), json.loads(made))) or "another content"
    except (ValueError, KeyError):
        return "another content"


def _scenes() -> dict[str, Json]:
    """Every case before it is run, by its name."""
    scenes = [scene for stage in STAGES.values() for scene in stage.scenes()]
    if twice := [name for name, count in Counter(scene["case"] for scene in scenes).items() if count > 1]:
        raise GoldenError(f"two cases share a name: {twice}")
    return {scene["case"]: scene for scene in scenes}


def _files(scenes: dict[str, Json]) -> dict[str, bytes]:
    """Relative path and content of every file, the manifest last; made in memory."""
    console = Console(stderr=True)
    faults: list[str] = []
    for name in track(scenes, "golden vectors", console=console, disable=not console.is_terminal):
        try:
            forms.PENDING[f"cases/{name}.json"] = _kept(finish(scenes[name]))
        except GoldenError as error:
            faults.append(str(error))
    if faults:
        raise GoldenError("\n".join(faults))
    given = {
        kind: {f"{kind}/{path.name}": digest(path.read_bytes()) for path in sorted((ROOT / kind).iterdir())}
        for kind in ("spectra", "dng")
    }
    manifest = {
        "format": FORMAT,
        "generator": generator_digest(),
        **given,
        "cases": {name: digest(forms.PENDING[f"cases/{name}.json"]) for name in sorted(scenes)},
    }
    text = json.dumps(manifest, indent=1, ensure_ascii=False) + "\n"
    return forms.PENDING | {"manifest.json": text.encode()}


def _kept(made: Json) -> bytes:
    """The case with its stored numbers if they have not drifted, so that rounding on this machine changes no file."""
    path = ROOT / "cases" / f"{made['case']}.json"
    if path.exists():
        stored = json.loads(path.read_bytes()) | {"comment": made["comment"]}
        fields = [[set(case.get(part) or {}) for part in NUMBERS] for case in (stored, made)]
        if set(stored) == set(made) and fields[0] == fields[1] and not drift(stored, made):
            return _text(stored)
    return _text(made)


def finish(scene: Json) -> Json:
    """The complete case of a scene: outputs by the reference, oracle by cvxpy, limits."""
    name, success = scene["case"], scene["expect"] == "success"
    stage, inputs = STAGES[name.partition("/")[0]], _plain(scene["inputs"])
    check_keys(f"{name}: inputs", inputs, stage.inputs, stage.optional)
    basis = inputs.get("basis")
    made: Json = {
        "format": FORMAT,
        "case": name,
        "stage": stage.name,
        "comment": scene["comment"],
        "expect": scene["expect"],
        "requires": (stage.requires or stage.name).split(),
        "basis_sha256": load_model(basis).metadata["basis_sha256"] if basis in SHIPPED else None,
        "inputs": inputs,
        "outputs": None,
        "oracle": None,
        "truth": None,
        "limits": [],
    }
    if success and stage.convex:
        made["oracle"] = _plain(consult(problem(made), made["inputs"]))
        if faults := _unproven(made):
            raise GoldenError(f"{name}: {', '.join(faults)}")
    try:
        outputs = run(made)
    except CalibrationError as error:
        if error.code == scene["expect"]:
            return check(made)
        raise GoldenError(f"{name}: expected {scene['expect']}, found {error.code} ({error})") from error
    if not success:
        raise GoldenError(f"{name}: expected {scene['expect']}, found success")
    kept = {output: _stored(output, outputs[output], stage) for output in stage.stored_outputs()}
    made["outputs"] = _plain(kept) | (scene["outputs"] or {})
    if scene["rmse"] is not None:
        off = rmse(outputs["ssf"], resolve(scene["truth"]))
        if not off <= MARGIN * scene["rmse"]:
            raise GoldenError(f"{name}: RMSE {off:.4f} leaves no margin below {scene['rmse']}")
        made["truth"] = {"ssf": scene["truth"], "measured": {"rmse": round(off, 4)}}
    made["limits"] = stage.limits_of(made, scene)
    if scene["outputs"] is not None:
        computed = {output: outputs.get(output) for output in scene["outputs"]}
        if not all(finding.holds for finding in judge(made, outputs)):
            raise GoldenError(f"{name}: expected {scene['outputs']}, computed {computed}")
    return check(made)


def _stored(name: str, value: Any, stage: Stage) -> Any:
    """A value as it is stored: None for a missing band, and large arrays with fewer digits."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).all():
        return None
    if value is None or name not in stage.rounded:
        return value
    return np.vectorize(lambda v: float(f"{v:.{DIGITS}g}"))(value)


def _plain(value: Any) -> Any:
    """The value with arrays as lists."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(v) for v in value] if isinstance(value, list | tuple) else value


def _text(case: Json) -> bytes:
    """The case as JSON with one line for each key, and for each value one level below."""

    def line(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))

    lines = []
    for key, value in case.items():
        if isinstance(value, dict) and value:
            inner = ",\n".join(f"  {line(k)}: {line(v)}" for k, v in value.items())
            lines.append(f" {line(key)}: {{\n{inner}\n }}")
        else:
            lines.append(f" {line(key)}: {line(value)}")
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def drift(stored: Json, made: Json) -> list[str]:
    """The differences between a stored case and the same case made now that exceed its limits."""
    faults = [f"{key} differs" for key in stored if key not in NUMBERS and stored[key] != made[key]]
    if stored["expect"] != "success" or faults:
        return faults
    for limit in stored["limits"]:
        kind, value, bound = limit["against"], limit["value"], limit["bound"]["float64"]
        if kind == "truth":
            if stored["truth"]["ssf"] != made["truth"]["ssf"]:
                faults.append("another truth")
        elif METRICS[limit["metric"]](made[kind][value], stored[kind][value]) > bound:
            faults.append(f"{value} of the {kind} by more than {bound:g} ({limit['metric']})")
    return faults + (_unproven(stored) if stored["oracle"] is not None else [])


class Proof(NamedTuple):
    """Objective and relative gap of one problem's code, and the largest gap allowed on this machine."""

    objective: float
    gap: float
    bound: float


def proofs(case: Json) -> list[Proof]:
    """Objective and gap of the stored oracle's code, recomputed for each problem without cvxpy."""
    l2, gamma, nonnegative = (case["inputs"][name] for name in ("l2", "gamma", "nonnegative"))
    rows, codes = problem(case), np.array(case["oracle"]["x"])
    return [
        Proof(*optimality(A, b, S, x, l2, gamma, nonnegative), ORACLE_GAP + blur(A, b, S, x, l2, gamma))
        for A, b, S, x in zip(rows.matrix, rows.target, rows.covariance, codes, strict=True)
    ]


def _unproven(case: Json) -> list[str]:
    """The oracle's gaps that are too large, in words."""
    return [
        f"the oracle's gap is {proof.gap:.1e}, not {proof.bound:.1e}"
        for proof in proofs(case)
        if not proof.gap <= proof.bound
    ]


if __name__ == "__main__":
    sys.exit(main())
