"""The only writer of golden/: `python -m golden.generate` writes, `--check` tests that nothing has drifted.

`--check` makes everything again in memory and compares it with the files:

- what is reproducible on any machine must be identical: names, comments, expectations, inputs, limits, sources,
  spectra, the manifest;
- outputs must agree with the stored ones within the case's limits (another BLAS or CPU rounds differently); the
  number of identical files is printed;
- the oracle's numbers must agree with the stored ones within the limits for all others, and the gap recomputed from
  the stored code must keep its own bound, plus a bound on rounding (`compare.blur`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from camssf.errors import CalibrationError
from camssf.files import write_file
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import widened
from camssf.recovery.hypotheses import AUTO
from camssf.recovery.layers import DEPTH
from camssf.recovery.onnx_model import load_model
from camssf.recovery.pivoting import SETTLED
from golden import reading
from golden.compare import METRICS, blur, optimality, rmse
from golden.reading import FORMAT, ROOT, GoldenError, Json, check, digest, paths, read_case, resolve
from golden.running import basis_of, findings, problem, run

GAP = 1e-9
"""Largest relative duality gap of any engine's result."""
ORACLE_GAP = 5e-10
"""Largest relative duality gap of the oracle's solution, apart from rounding (`Proof.bound`)."""
MARGIN = 0.9
"""At generation the RMSE against the truth must be below this fraction of its bound."""
ARRIVED, ERRING = 1e-9, 1e-6
"""Distance between a curve of layers and the optimum, relative to the peak, that is rounding; and the relative
tolerance with which a larger distance must be reproduced."""
DIGITS = 12
"""Significant digits stored for curves, bands and W; more precise than their limits of 1e-10."""
COMMAND = "python -m golden.generate"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; returns 0 on success, 1 if something drifted or violates a limit, 2 if cvxpy is missing."""
    parser = argparse.ArgumentParser(prog=COMMAND, description="Write the golden vectors, or check them.")
    parser.add_argument("--check", action="store_true", help="write nothing: make all anew and compare")
    options = parser.parse_args(arguments)
    try:
        import cvxpy  # noqa: F401
    except ImportError:
        print("cvxpy is missing: the oracle needs it. Install the extra dev.", file=sys.stderr)
        return 2
    try:
        files = dict(_files(keep=not options.check))
    except GoldenError as error:
        print(f"golden: {error}", file=sys.stderr)
        return 1
    finally:
        reading.PENDING.clear()
    if options.check:
        return _check_files(files)
    _write(files)
    size = sum(len(content) for content in files.values())
    print(f"{sum(name.startswith('cases/') for name in files)} cases, {size / 1e6:.1f} MB written")
    return 0


def _files(keep: bool) -> Iterable[tuple[str, bytes]]:
    """Relative path and content of every file, the manifest last; made in memory.

    keep: a stored case within its own limits stays as it is, so that rounding on this machine changes no file.
    """
    from rich.console import Console
    from rich.progress import track

    from golden.colours import colours, regions
    from golden.finders import finders
    from golden.mosaics import mosaics
    from golden.poses import poses
    from golden.scenes import cases
    from golden.tables import write_tables
    from golden.verdicts import verdicts

    spectra = {f"spectra/{name}.json": _text(table) for name, table in write_tables().items()}
    reading.PENDING.update(spectra)
    yield from spectra.items()
    entries: dict[str, str] = {}
    faults: list[str] = []
    scenes = [*mosaics(), *poses(), *cases(), *verdicts(), *colours(), *regions(), *finders()]
    photos = {name: content for scene in scenes for name, content in scene.get("files", {}).items()}
    reading.PENDING.update(photos)
    yield from sorted(photos.items())
    names = [scene["case"] for scene in scenes]
    if len(set(names)) < len(names):
        raise GoldenError(f"two cases share a name: {sorted({n for n in names if names.count(n) > 1})}")
    console = Console(stderr=True)
    for scene in track(scenes, "golden vectors", console=console, disable=not console.is_terminal):
        try:
            made = finish(scene)
        except GoldenError as error:
            faults.append(str(error))
            continue
        path = f"cases/{made['case']}.json"
        content = _kept(path, made) if keep else _text(made)
        reading.PENDING[path] = content
        entries[made["case"]] = digest(content)
        yield path, content
    if faults:
        raise GoldenError("\n".join(faults))
    manifest = {
        "format": FORMAT,
        "count": len(entries),
        "generator": reading.generator_digest(),
        "spectra": {name: digest(content) for name, content in spectra.items()},
        "dng": {name: digest(content) for name, content in sorted(photos.items())},
        "cases": dict(sorted(entries.items())),
    }
    yield "manifest.json", (json.dumps(manifest, indent=1, ensure_ascii=False) + "\n").encode()


def finish(scene: Json) -> Json:
    """The complete case of a scene: outputs by the reference, oracle by cvxpy, limits."""
    stage = scene["case"].partition("/")[0]
    inputs = _plain(scene["inputs"])
    made: Json = {
        "format": FORMAT,
        "case": scene["case"],
        "stage": stage,
        "comment": scene["comment"],
        "expect": scene["expect"],
        "requires": _requires(stage, inputs),
        "source": _source(inputs),
        "inputs": inputs,
        "outputs": None,
        "oracle": None,
        "truth": None,
        "limits": [],
    }
    if stage == "mosaic" and scene["expect"] == "success":
        return _written(made, scene)
    if scene["expect"] != "success":
        try:
            run(made)
        except CalibrationError as error:
            if error.code == scene["expect"]:
                return check(made)
            raise GoldenError(f"{made['case']}: expected {scene['expect']}, found {error.code} ({error})") from error
        raise GoldenError(f"{made['case']}: expected {scene['expect']}, found success")
    if stage in ("solve", "ssf", "layers"):
        made["oracle"] = _plain(_oracle(made))
    try:
        outputs = run(made)
    except CalibrationError as error:
        raise GoldenError(f"{made['case']}: {error.code}: {error}") from error
    kept = {name: _stored(name, outputs[name], stage) for name in sorted(reading.OUTPUTS[stage])}
    made["outputs"] = _plain(kept)
    if scene["truth"] is not None:
        made["truth"] = {
            "ssf": scene["truth"],
            "measured": _truth(made, outputs["ssf"], scene["truth"], scene["rmse"]),
        }
    made["limits"] = _limits(made, scene)
    return check(made)


def _written(made: Json, scene: Json) -> Json:
    """A case whose outputs are the values written to its file; the reference must read the same."""
    made["outputs"] = scene["outputs"]
    made["limits"] = _limits(made, scene)
    broken = [finding for finding in findings(made) if not finding.holds]
    if broken:
        raise GoldenError(f"{made['case']}: {broken}")
    return check(made)


def _oracle(made: Json) -> Json:
    from golden.oracle import consult

    given, sensing = made["inputs"], problem(made)
    gamma = np.broadcast_to(np.array(given["gamma"], float), len(sensing.matrix))
    basis = white = None
    if made["stage"] in ("ssf", "layers"):
        basis = widened(basis_of(given["basis"]), given.get("prior_scale", 1.0))
        white = resolve(given["white_reflectance"]) * resolve(given["lamp"])[0]
    oracle = consult(sensing, given["l2"], gamma, given["nonnegative"], basis, white)
    for proof in proofs(made | {"oracle": oracle}):
        if not proof.gap <= proof.bound:
            raise GoldenError(f"{made['case']}: the oracle's own gap is {proof.gap:.1e}, not {proof.bound:.1e}")
    return oracle


def _truth(made: Json, found: Floats, truth: Json, bound: float) -> Json:
    measured = rmse(found, resolve(truth))
    if not measured <= MARGIN * bound:
        raise GoldenError(f"{made['case']}: RMSE {measured:.4f} leaves no margin below {bound}")
    return {"rmse": round(measured, 4)}


def _limits(made: Json, scene: Json) -> list[Json]:
    """The case's limits: value, what it is compared with, metric and bound."""

    def limit(value: str, against: str, metric: str, bound: float, *requires: str) -> Json:
        return {"value": value, "against": against, "metric": metric, "bound": {"float64": bound},
                "requires": list(requires)}  # fmt: skip

    stage, outputs = made["stage"], made["outputs"]
    port: dict[str, list[tuple[str, str, float]]] = {
        "mosaic": [(name, "norm" if name in _ROUNDED else "exact", 1e-15 if name in _ROUNDED else 0.0)
                   for name in sorted(reading.OUTPUTS["mosaic"] - _METADATA)],
        "pose": [("corners", "norm", 1e-9), ("quads", "norm", 1e-9), ("quarter_turns", "exact", 0.0),
                 ("score", "norm", 1e-9), ("kept", "exact", 0.0)],
        "patches": [(name, *_statistic(name, made["inputs"])) for name in sorted(reading.OUTPUTS["patches"])],
        "signals": [("signals", "norm", 1e-15), ("standard_error", "norm", 1e-14), ("used", "exact", 0.0),
                    ("assumptions", "exact", 0.0)],
        "sensing": [("matrix", "norm", 1e-12), ("target", "norm", 1e-12), ("covariance", "norm", 1e-12)],
        "weights": [("rho", "norm", 1e-15), ("W", "norm", 1e-10), ("z", "norm", 1e-10)],
        "solve": [("objective", "relative", 1e-10), ("evidence", "relative", 1e-10)],
        "ssf": [("ssf", "norm", 1e-10), ("ssf_std", "norm", 1e-10), ("code_covariance", "sums", 1e-10),
                ("signals", "norm", 1e-15), ("predicted", "norm", 1e-10), ("predicted_std", "norm", 1e-10),
                ("budget", "norm", 1e-10), ("evidence", "relative", 1e-10), ("channel_gain", "norm", 1e-14)],
        "choice": [("weighed", "exact", 0.0), ("log_evidence", "relative", 1e-10), ("probability", "norm", 1e-8),
                   ("basis", "exact", 0.0), ("prior_scale", "exact", 0.0), ("ssf", "norm", 1e-9),
                   ("ssf_std", "norm", 1e-9), ("predicted", "norm", 1e-9)],
        "light": [("weighed", "exact", 0.0), ("log_evidence", "relative", 1e-10), ("probability", "norm", 1e-8),
                  ("basis", "exact", 0.0), ("prior_scale", "exact", 0.0), ("likeliest", "exact", 0.0),
                  ("ssf", "norm", 1e-9), ("ssf_std", "norm", 1e-9), ("predicted", "norm", 1e-9),
                  ("rmsre_percent", "norm", 1e-8), ("kinds", "norm", 1e-8), ("power", "norm", 1e-9),
                  ("power_std", "norm", 1e-9),
                  ("kelvin", "relative", 1e-9), ("kelvin_std", "relative", 1e-9), ("status", "exact", 0.0),
                  ("codes", "exact", 0.0), ("messages", "exact", 0.0), ("values", "relative", 1e-8),
                  ("thresholds", "relative", 1e-15), ("said", "exact", 0.0)],
        "rivals": [("gains", "norm", 1e-8)],
        "layers": [("ssf", "peak", 1e-10)],
        "calibrate": [("signals", "norm", 1e-15), ("used", "exact", 0.0), ("ssf", "norm", 1e-10),
                      ("ssf_std", "norm", 1e-10), ("predicted", "norm", 1e-10), ("channel_gain", "norm", 1e-14),
                      ("rmsre_percent", "norm", 1e-8), ("codes", "exact", 0.0)],
        "verdict": [("status", "exact", 0.0), ("codes", "exact", 0.0), ("messages", "exact", 0.0),
                    ("advice", "exact", 0.0), ("fatal", "exact", 0.0),
                    ("checks", "exact", 0.0), ("checked", "norm", 1e-9),
                    ("named", "exact", 0.0), ("values", "relative", 1e-8), ("thresholds", "relative", 1e-15),
                    ("residual", "relative", 1e-8), ("prior", "relative", 1e-12), ("count", "exact", 0.0),
                    ("z", "norm", 1e-8), ("gains", "norm", 1e-8)],
        "colour": [("xyz", "norm", 1e-12), ("lab", "norm", 1e-12), ("xyz_covariance", "norm", 1e-12),
                   ("lab_covariance", "norm", 1e-12), ("parts", "norm", 1e-12), ("white", "norm", 1e-14),
                   ("lamps", "exact", 0.0), ("weights", "norm", 1e-12), ("kinds", "exact", 0.0),
                   ("surprise", "relative", 1e-12), ("far", "exact", 0.0), ("reach", "norm", 1e-9)],
        "regions": [("raw", "norm", 1e-14), ("standard_error", "norm", 1e-13)],
        # Pictures are below 2000 px wide: 1e-13 of that is far below the required 1e-9 px.
        "finder": [("findings", "exact", 0.0), ("kinds", "exact", 0.0), ("mirrored", "exact", 0.0),
                   ("seen", "exact", 0.0), ("corners", "norm", 1e-13), ("patches", "norm", 1e-13),
                   ("confidence", "norm", 3e-9)],
    }  # fmt: skip
    found = [limit(v, "outputs", m, bound) for v, m, bound in port[stage] if outputs[v] is not None]
    if stage == "mosaic":
        found += [limit(name, "outputs", "norm" if name in _ROUNDED else "exact",
                        1e-15 if name in _ROUNDED else 0.0, "metadata")
                  for name in sorted(_METADATA) if outputs[name] is not None]  # fmt: skip
    if stage == "solve" and scene["generic"]:
        found += [limit("code", "outputs", "norm", 1e-9), limit("finish_steps", "outputs", "exact", 0.0)]
    if stage == "ssf" and not np.any(outputs["finish_steps"]):
        found += [
            limit("finish_steps", "outputs", "at_most", 0.0),
            limit("layers_gap", "outputs", "at_most", SETTLED),
        ]
    if stage == "layers":
        return found + _layers_limits(made, limit)
    if stage in ("calibrate", "choice", "light"):
        found.append(limit("gap", "outputs", "at_most", GAP))
    if made["oracle"] is not None:
        found.append(limit("objective", "oracle", "relative", 1e-9, *(["reference"] if stage == "ssf" else [])))
        found.append(limit("gap", "oracle", "at_most", GAP))
        if made["oracle"]["ssf"] is not None:
            found.append(limit("ssf", "oracle", "peak", 1e-6))
    if made["truth"] is not None:
        found.append(limit("ssf", "truth", "rmse", scene["rmse"]))
    return found


def _layers_limits(made: Json, limit: Any) -> list[Json]:
    """Limits of the stage `layers`: the product's layers reach the optimum; others must match the stored values."""
    product = "model" in made["requires"]
    if product or made["outputs"]["distance"] <= ARRIVED:
        return [
            limit("ssf", "oracle", "peak", 1e-7),
            limit("objective", "oracle", "relative", 1e-10, *(["reference"] if product else [])),
            limit("gap", "oracle", "at_most", 1e-10),
        ] + ([limit("finish_steps", "outputs", "at_most", 0.0)] if product else [])
    return [
        limit("objective", "outputs", "relative", 1e-9),
        *(limit(name, "outputs", "relative", ERRING) for name in ("distance", "gap")),
    ]


def _statistic(name: str, inputs: Json) -> tuple[str, float]:
    """Metric and bound of a patch statistic; quotients of integer sums are exact, unless a gain was applied."""
    plain = inputs.get("lens_shading") == "as-stored"
    if name.endswith(("_standard_error", "_gradient")):
        return "norm", 1e-13
    return ("norm", 1e-15) if name.endswith(("_mean", "_greens")) and not plain else ("exact", 0.0)


_METADATA = {"as_shot_white_xy", "noise_profile", "masked_areas", "bad_pixels"}
"""Fields of a file that Python does not read."""
_ROUNDED = {"black", "color_matrix1", "color_matrix2", "as_shot_neutral", "as_shot_white_xy"}
"""Fields that are quotients, and so rounded."""


_LIGHT = {("light", "power"), ("light", "power_std"), ("light", "predicted")}
"""Further curves stored with DIGITS digits: (stage, name)."""


def _requires(stage: str, inputs: Json) -> list[str]:
    if stage in ("mosaic", "pose", "patches", "signals", "verdict", "colour", "finder"):
        return [stage]
    if stage == "regions":
        return ["patches"]
    if stage in ("calibrate", "light", "rivals"):
        return ["signals", "model"]
    if stage == "layers":
        return ["model"] if (inputs["iteration"], inputs["depth"]) == ("splitting", DEPTH) else ["reference"]
    return ["model"] if stage in ("ssf", "choice") else ["reference"]


def _source(inputs: Json) -> Json:
    """The source of a case: the basis with the hash in the shipped model's metadata, the spectra by name."""
    basis = _basis(inputs)
    shipped = isinstance(basis, str)
    one = isinstance(basis, str) and basis != AUTO
    return {
        "generator": COMMAND,
        "basis": basis,
        "basis_sha256": load_model(basis).metadata["basis_sha256"] if one else None,
        "spectra": sorted(_names(inputs)),
    } | (
        {} if shipped else {"basis": None if basis is None else f"{basis['count']} Gaussians of {basis['width']} nm"}
    )


def _basis(inputs: Json) -> Any:
    if "basis" in inputs:
        return inputs["basis"]
    parent = inputs.get("matrix")
    if isinstance(parent, dict):
        return reading.sibling(parent["case"])["inputs"]["basis"]
    return None


def _names(value: Any) -> set[str]:
    if isinstance(value, dict):
        found = {f"charts:{value['chart']}"} if isinstance(value.get("chart"), str) else set()
        found |= {f"lamps:{name}" for name in value.get("lamps", []) if name != "equal-energy"}
        found |= {f"modes:{name}" for name in value.get("modes", []) if name}
        return found.union(*(_names(v) for v in value.values()), set())
    return set()


def _stored(name: str, value: Any, stage: str) -> Any:
    """A value as it is stored: None for a missing band, and large arrays with fewer numbers or digits."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f" and np.isnan(value).all():
        return None
    if value is None or not (name in ("ssf", "ssf_std", "code_covariance", "W") or (stage, name) in _LIGHT):
        return value
    if name == "code_covariance":
        return value.reshape(len(value), 3, -1).sum(axis=2)
    if stage == "layers":
        value = (value / value.max(axis=0))[::10]
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


def _place(files: dict[str, bytes]) -> None:
    """Write the files that changed, each atomically."""
    for name, content in files.items():
        path = ROOT / name
        if path.exists() and path.read_bytes() == content:
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        write_file(path, content)


def _kept(name: str, made: Json) -> bytes:
    """The stored case if it has the same fields and has not drifted, else the new one."""
    path = ROOT / name
    if path.exists():
        stored = json.loads(path.read_bytes())
        fields = [set(case.get(part) or {}) for case in (stored, made) for part in ("outputs", "oracle", "truth")]
        if set(stored) == set(made) and fields[:3] == fields[3:] and not drift(stored, made):
            return path.read_bytes()
    return _text(made)


def _write(files: dict[str, bytes]) -> None:
    """Write all files, and delete those that no scene makes."""
    _place(files)
    for path in [*paths(), *(ROOT / "dng").glob("*")]:
        if path.relative_to(ROOT).as_posix() not in files:
            path.unlink()


def _check_files(files: dict[str, bytes]) -> int:
    faults = [f"{path.relative_to(ROOT)}: no scene makes it" for path in [*paths(), *(ROOT / "dng").glob("*")]
              if path.relative_to(ROOT).as_posix() not in files]  # fmt: skip
    same = 0
    for name, content in files.items():
        path = ROOT / name
        stored = path.read_bytes() if path.exists() else None
        if stored == content:
            same += 1
        elif stored is None:
            faults.append(f"{name}: missing")
        elif name.startswith("cases/"):
            faults += [f"{name}: {fault}" for fault in drift(read_case(path), json.loads(content))]
        elif name == "manifest.json":
            faults += _manifest_drift(json.loads(stored), json.loads(content))
        else:
            faults.append(f"{name}: another content")
    for fault in faults:
        print(fault)
    print(f"{len(files)} files, {same} equal to the bit, {len(faults)} drifted")
    if faults:
        print(f"If that is meant, run `{COMMAND}`.", file=sys.stderr)
    return 1 if faults else 0


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
    if stored["oracle"] is not None:
        faults += [
            f"the stored oracle's gap is {proof.gap:.1e}, not {proof.bound:.1e}"
            for proof in proofs(stored)
            if not proof.gap <= proof.bound
        ]
    return faults


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


def _manifest_drift(stored: Json, made: Json) -> list[str]:
    """The faults of the stored manifest; hashes of cases need only match the files, all else must be equal."""
    keys = ("format", "count", "generator", "spectra", "dng")
    faults = [f"manifest.json: {key} differs" for key in keys if stored.get(key) != made[key]]
    if set(stored.get("cases", {})) != set(made["cases"]):
        faults.append("manifest.json: another list of cases")
    for name, value in stored.get("cases", {}).items():
        path = ROOT / "cases" / f"{name}.json"
        if not path.exists() or digest(path.read_bytes()) != value:
            faults.append(f"manifest.json: the hash of {name} is not the file's")
    return faults


assert WAVELENGTHS.size == 681  # the scenes contain this number in shapes

if __name__ == "__main__":
    sys.exit(main())
