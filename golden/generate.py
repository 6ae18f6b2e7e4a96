"""The only writer of golden/: `python -m golden.generate` writes, `--check` tests that nothing has drifted.

Both make everything in memory. A stored case stays as it is to the bit if the one made now has the same inputs and
limits, its outputs agree with the stored ones within the limits (another BLAS or CPU rounds differently), and the
stored oracle proves itself: its gap, computed anew, keeps its bound and one on rounding (`compare.blur`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import track

from camssf.errors import CalibrationError
from camssf.files import write_file
from camssf.recovery.basis import widened
from camssf.recovery.hypotheses import AUTO
from camssf.recovery.onnx_model import load_model
from golden import forms
from golden.compare import METRICS, blur, optimality, rmse
from golden.contract import Stage
from golden.forms import ROOT, GoldenError, Json, digest, resolve
from golden.oracle import consult
from golden.products import basis_of
from golden.reading import FORMAT, check, generator_digest, paths
from golden.running import judge, problem, run
from golden.stages import STAGES
from golden.tables import write_tables

ORACLE_GAP = 5e-10
"""Largest relative duality gap of the oracle's solution, apart from rounding (`Proof.bound`)."""
MARGIN = 0.9
"""At generation the RMSE against the truth must be below this fraction of its bound."""
DIGITS = 12
"""Significant digits stored for curves, bands and W; more precise than their limits of 1e-10."""
COMMAND = "python -m golden.generate"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 0 on success, 1 if something drifted or violates a limit, 2 if cvxpy is missing."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Write the golden vectors, or check them.")
    parser.add_argument("--check", action="store_true", help="write nothing: make all anew and compare")
    parser.add_argument("case", nargs="*", help="write nothing: print what becomes of these, as verdict/haze")
    options = parser.parse_args(arguments)
    try:
        import cvxpy  # noqa: F401
    except ImportError:
        print("cvxpy is missing: the oracle needs it. Install the extra dev.", file=sys.stderr)
        return 2
    try:
        if options.case:
            print(*_outcomes(options.case), sep="\n")
            return 0
        made = dict(_files())
    except GoldenError as error:
        print(f"golden: {error}", file=sys.stderr)
        return 1
    finally:
        forms.PENDING.clear()
    known = [*paths(), *(ROOT / "dng").glob("*"), *(ROOT / "spectra").glob("*"), ROOT / "manifest.json"]
    stored = {path.relative_to(ROOT).as_posix(): path.read_bytes() for path in known if path.exists()}
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


def _outcomes(names: Sequence[str]) -> Iterable[str]:
    """A line on each of these cases: whether its row's expectation holds, else `GoldenError` says what was found."""
    forms.PENDING.update({f"spectra/{name}.json": _text(table) for name, table in write_tables().items()})
    scenes = {scene["case"]: scene for stage in STAGES.values() for scene in stage.cases()}
    if unknown := set(names) - scenes.keys():
        raise GoldenError(f"no such case: {', '.join(sorted(unknown))}")
    for name in names:
        forms.PENDING.update(scenes[name]["files"])
        made = finish(scenes[name])
        stated = {key: (made["outputs"] or {}).get(key) for key in ("status", "codes")}
        yield f"{name}: {made['expect']}, as its row says{'' if None in stated.values() else f': {stated}'}"


def _change(stored: bytes | None, made: bytes | None) -> str:
    """What is different about a file, in words."""
    if stored is None or made is None:
        return "missing" if stored is None else "no scene makes it"
    try:
        return ", ".join(drift(json.loads(stored), json.loads(made))) or "another content"
    except (ValueError, KeyError):
        return "another content"


def _files() -> Iterable[tuple[str, bytes]]:
    """Relative path and content of every file, the manifest last; made in memory."""
    spectra = {f"spectra/{name}.json": _text(table) for name, table in write_tables().items()}
    forms.PENDING.update(spectra)
    yield from spectra.items()
    scenes = [scene for stage in STAGES.values() for scene in stage.cases()]
    photos = {name: content for scene in scenes for name, content in scene["files"].items()}
    forms.PENDING.update(photos)
    yield from photos.items()
    names = [scene["case"] for scene in scenes]
    if len(set(names)) < len(names):
        raise GoldenError(f"two cases share a name: {sorted({n for n in names if names.count(n) > 1})}")
    console = Console(stderr=True)
    cases: dict[str, str] = {}
    faults: list[str] = []
    for scene in track(scenes, "golden vectors", console=console, disable=not console.is_terminal):
        try:
            content = _kept(finish(scene))
        except GoldenError as error:
            faults.append(str(error))
            continue
        path = f"cases/{scene['case']}.json"
        forms.PENDING[path] = content
        cases[scene["case"]] = digest(content)
        yield path, content
    if faults:
        raise GoldenError("\n".join(faults))
    manifest = {
        "format": FORMAT,
        "count": len(cases),
        "generator": generator_digest(),
        "spectra": {name: digest(content) for name, content in spectra.items()},
        "dng": {name: digest(content) for name, content in sorted(photos.items())},
        "cases": dict(sorted(cases.items())),
    }
    yield "manifest.json", (json.dumps(manifest, indent=1, ensure_ascii=False) + "\n").encode()


def _kept(made: Json) -> bytes:
    """The case with its stored numbers if they have not drifted, so that rounding on this machine changes no file."""
    path = ROOT / "cases" / f"{made['case']}.json"
    if path.exists():
        stored = json.loads(path.read_bytes()) | {"comment": made["comment"]}
        fields = [set(case.get(part) or {}) for case in (stored, made) for part in ("outputs", "oracle", "truth")]
        if set(stored) == set(made) and fields[:3] == fields[3:] and not drift(stored, made):
            return _text(stored)
    return _text(made)


def finish(scene: Json) -> Json:
    """The complete case of a scene: outputs by the reference, oracle by cvxpy, limits."""
    stage = STAGES[scene["case"].partition("/")[0]]
    inputs = _plain(scene["inputs"])
    made: Json = {
        "format": FORMAT,
        "case": scene["case"],
        "stage": stage.name,
        "comment": scene["comment"],
        "expect": scene["expect"],
        "requires": (scene["requires"] or stage.requires).split(),
        "source": _source(inputs),
        "inputs": inputs,
        "outputs": None,
        "oracle": None,
        "truth": None,
        "limits": [],
    }
    success = scene["expect"] == "success"
    if success and stage.oracle:
        made["oracle"] = _plain(_oracle(made))
    try:
        outputs = run(made)
    except CalibrationError as error:
        if error.code == scene["expect"]:
            return check(made)
        raise GoldenError(f"{made['case']}: expected {scene['expect']}, found {error.code} ({error})") from error
    if not success:
        raise GoldenError(f"{made['case']}: expected {scene['expect']}, found success")
    kept = {name: _stored(name, outputs[name], stage) for name in stage.stored_outputs()}
    made["outputs"] = _plain(kept) | (scene["outputs"] or {})
    if scene["truth"] is not None:
        off = rmse(outputs["ssf"], resolve(scene["truth"]))
        if not off <= MARGIN * scene["rmse"]:
            raise GoldenError(f"{made['case']}: RMSE {off:.4f} leaves no margin below {scene['rmse']}")
        made["truth"] = {"ssf": scene["truth"], "measured": {"rmse": round(off, 4)}}
    made["limits"] = stage.limits_of(made, scene)
    if scene["outputs"] is not None:
        broken = [finding for finding in judge(made, outputs) if not finding.holds]
        if broken:
            raise GoldenError(f"{made['case']}: {broken}, found {[outputs.get(name) for name in scene['outputs']]}")
    return check(made)


def _oracle(made: Json) -> Json:
    given, sensing = made["inputs"], problem(made)
    gamma = np.broadcast_to(np.array(given["gamma"], float), len(sensing.matrix))
    basis = white = None
    if "basis" in given:
        basis = widened(basis_of(given["basis"]), given.get("prior_scale", 1.0))
        white = resolve(given["white_reflectance"]) * resolve(given["lamp"])[0]
    oracle = consult(sensing, given["l2"], gamma, given["nonnegative"], basis, white)
    faults = _unproven(made | {"oracle": oracle})
    if faults:
        raise GoldenError(f"{made['case']}: {', '.join(faults)}")
    return oracle


def _source(inputs: Json) -> Json:
    """The source of a case: the basis with the hash in the shipped model's metadata, the spectra by name."""
    parent = inputs.get("matrix")
    if isinstance(parent, dict):
        inputs = inputs | {"basis": forms.sibling(parent["case"])["inputs"]["basis"]}
    basis = inputs.get("basis")
    named = isinstance(basis, str)
    return {
        "generator": COMMAND,
        "basis": basis if named or basis is None else f"{basis['count']} Gaussians of {basis['width']} nm",
        "basis_sha256": load_model(basis).metadata["basis_sha256"] if named and basis != AUTO else None,
        "spectra": sorted(_names(inputs)),
    }


def _names(value: Any) -> set[str]:
    """The spectra that input forms name."""
    if not isinstance(value, dict):
        return set()
    found = {f"charts:{value['chart']}"} if isinstance(value.get("chart"), str) else set()
    found |= {f"lamps:{name}" for name in value.get("lamps", []) if name != "equal-energy"}
    found |= {f"modes:{name}" for name in value.get("modes", []) if name}
    return found.union(*(_names(v) for v in value.values()))


def _stored(name: str, value: Any, stage: Stage) -> Any:
    """A value as it is stored: None for a missing band, and large arrays with fewer numbers or digits."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).all():
        return None
    if value is None or name not in stage.rounded:
        return value
    if name == "code_covariance":
        return value.reshape(len(value), 3, -1).sum(axis=2)
    return np.vectorize(lambda v: float(f"{v:.{DIGITS}g}"))(value)


def _plain(value: Any) -> Any:
    """The value with arrays as lists."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


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
    numbers = ("outputs", "oracle", "truth")
    faults = [f"{key} differs" for key in stored if key not in numbers and stored[key] != made[key]]
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


def _unproven(case: Json) -> list[str]:
    """The oracle's gaps that are too large, in words."""
    return [
        f"the oracle's gap is {proof.gap:.1e}, not {proof.bound:.1e}"
        for proof in proofs(case)
        if not proof.gap <= proof.bound
    ]


class Proof(NamedTuple):
    """Objective and relative gap of one problem's code, and the largest gap allowed on this machine."""

    objective: float
    gap: float
    bound: float


def proofs(case: Json) -> list[Proof]:
    """Objective and gap of the stored oracle's code, recomputed for each problem without cvxpy."""
    given, sensing = case["inputs"], problem(case)
    gamma = np.broadcast_to(np.array(given["gamma"], float), len(sensing.matrix))
    return [
        Proof(
            *optimality(A, b, S, np.array(x), given["l2"], float(g), given["nonnegative"]),
            ORACLE_GAP + blur(A, b, S, np.array(x), given["l2"], float(g)),
        )
        for A, b, S, x, g in zip(
            sensing.matrix, sensing.target, sensing.covariance, case["oracle"]["x"], gamma, strict=True
        )
    ]


if __name__ == "__main__":
    sys.exit(main())
