"""Reads golden files: checks every key strictly, and converts input forms to arrays."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from camssf import errors
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import interpolate
from golden.compare import METRICS

Json: TypeAlias = dict[str, Any]
ROOT = Path(__file__).parent
FORMAT = 1
FIELDS = (
    "format", "case", "stage", "comment", "expect", "requires", "source", "inputs", "outputs", "oracle", "truth",
    "limits",
)  # fmt: skip
CAPABILITIES = (
    "mosaic", "pose", "patches", "signals", "reference", "model", "verdict", "metadata", "colour", "finder",
)  # fmt: skip
"""Capabilities of a runner; README.md explains each."""
_PROBLEM = {"matrix", "target", "covariance", "l2", "gamma", "nonnegative"}
_ROWS = {
    "basis", "reflectance", "chart_tolerance", "white_reflectance", "white_tolerance", "lamp", "lamp_tolerance",
    "lamp_modes",
}  # fmt: skip
_CALL = _ROWS | {"chart", "white", "dark", "standard_error", "l2", "gamma", "nonnegative"}
_SHOTS = {"shots", "patches", "white"}
_CAPTURE = {
    "shots", "reflectance", "chart_tolerance", "white", "lamp", "lamp_tolerance", "lamp_modes", "white_reflectance",
    "basis", "l2", "gamma", "nonnegative",
}  # fmt: skip
INPUTS: dict[str, set[str]] = {
    "mosaic": {"dng"},
    "pose": {"dng", "table", "corners"},
    "patches": {"photo", "white", "dark", "quads", "lens_shading"},
    "signals": _SHOTS,
    "sensing": _ROWS | {"signals", "standard_error"},
    "weights": _PROBLEM | {"depths"},
    "solve": _PROBLEM | {"depth", "finish"},
    "ssf": _CALL,
    "layers": _CALL | {"iteration", "depth"},
    "choice": _CALL | {"prior"},
    "calibrate": _CAPTURE,
    "light": _CAPTURE | {"unnamed"},
    "rivals": _CAPTURE,
    "verdict": {"reflectance", "chart_tolerance", "white_reflectance", "white_tolerance", "lamp", "lamp_tolerance",
                "lamp_modes", "signals", "standard_error", "used", "white_is_patch", "white", "dark", "shots",
                "centres", "ssf", "ssf_std", "code", "predicted", "alone", "rivals", "neutrals"},
    "colour": {"result", "lamp", "signals", "standard_error", "reference", "view"},
    "regions": {"photo", "areas", "dark", "lens_shading"},
    "finder": {"dng", "form"},
}  # fmt: skip
MAY: dict[str, set[str]] = {
    "sensing": {"gain_modes", "gain_own"},
    "ssf": {"prior_scale", "gain_modes", "gain_own"},
    "calibrate": {"make", "model", "light_per_patch"},
    "light": {"make", "model"},
    "rivals": {"make", "model"},
    "verdict": {"choice", "family", "code_variance", "unnamed", "gain_modes", "gain_own"},
}
"""Optional inputs of a case; README.md gives their defaults."""
_STATISTICS = {"mean", "standard_error", "count", "clipped", "dead", "gradient", "greens"}
OUTPUTS: dict[str, set[str]] = {
    "mosaic": {
        "sha256",
        "width",
        "height",
        "samples_sha256",
        "cfa",
        "black",
        "white",
        "make",
        "model",
        "exposure",
        "iso",
        "orientation",
        "color_matrix1",
        "color_matrix2",
        "as_shot_neutral",
        "gain_maps",
        "as_shot_white_xy",
        "noise_profile",
        "masked_areas",
        "bad_pixels",
    },
    "pose": {"corners", "quads", "quarter_turns", "score", "kept"},
    "patches": {f"{frame}_{name}" for frame in ("chart", "white", "dark") for name in _STATISTICS}
    | {"black", "saturation"},
    "signals": {"signals", "standard_error", "used", "assumptions"},
    "sensing": {"matrix", "target", "covariance"},
    "weights": {"rho", "W", "z"},
    "solve": {"code", "objective", "gap", "layers_gap", "finish_steps", "evidence"},
    "ssf": {
        "ssf",
        "ssf_std",
        "code",
        "code_covariance",
        "signals",
        "predicted",
        "predicted_std",
        "budget",
        "gap",
        "layers_gap",
        "finish_steps",
        "evidence",
        "channel_gain",
    },
    "layers": {"ssf", "objective", "gap", "finish_steps", "distance"},
    "choice": {
        "weighed",
        "log_evidence",
        "probability",
        "basis",
        "prior_scale",
        "ssf",
        "ssf_std",
        "predicted",
        "gap",
    },
    "light": {
        "weighed",
        "log_evidence",
        "probability",
        "basis",
        "prior_scale",
        "likeliest",
        "ssf",
        "ssf_std",
        "predicted",
        "gap",
        "rmsre_percent",
        "kinds",
        "power",
        "power_std",
        "kelvin",
        "kelvin_std",
        "status",
        "codes",
        "messages",
        "values",
        "thresholds",
        "said",
    },
    "rivals": {"gains"},
    "calibrate": {"signals", "used", "ssf", "ssf_std", "predicted", "gap", "channel_gain", "rmsre_percent", "codes"},
    "verdict": {
        "status",
        "codes",
        "fatal",
        "values",
        "thresholds",
        "named",
        "residual",
        "prior",
        "count",
        "z",
        "gains",
        "messages",
        "advice",
        "checks",
        "checked",
    },
    "colour": {
        "xyz",
        "lab",
        "xyz_covariance",
        "lab_covariance",
        "parts",
        "white",
        "lamps",
        "weights",
        "kinds",
        "surprise",
        "far",
        "reach",
    },
    "regions": {"raw", "standard_error"},
    "finder": {"findings", "kinds", "mirrored", "seen", "corners", "patches", "confidence"},
}
ORACLE = {"solver", "polished", "x", "objective", "gap", "ssf"}
AGAINST = ("outputs", "oracle", "truth")
_FRAME = {"mean", "standard_error", "clipped"}
_FULL_FRAME = _FRAME | {"count", "dead", "greens"}


class GoldenError(ValueError):
    """A golden file violates the format."""


def codes() -> set[str]:
    """All error codes of `camssf.errors`."""
    kinds = [getattr(errors, name) for name in vars(errors)]
    kinds = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, errors.CalibrationError)]
    return {kind.code for kind in kinds} - {errors.CalibrationError.code}


def check(case: Json) -> Json:
    """Return the case if it follows format 1.

    Raises:
        GoldenError: an unknown or missing key, or a value that is not allowed.
    """
    _keys("the case", case, set(FIELDS))
    name = case["case"]
    _need(case["format"] == FORMAT, f"{name}: format {case['format']!r} is not {FORMAT}")
    stage = case["stage"]
    _need(stage in INPUTS, f"{name}: there is no stage {stage!r}")
    _need(isinstance(name, str) and name.startswith(f"{stage}/"), f"{name}: does not belong to the stage {stage}")
    _need(isinstance(case["comment"], str) and bool(case["comment"]), f"{name}: has no comment")
    _need(case["expect"] == "success" or case["expect"] in codes(), f"{name}: expects {case['expect']!r}")
    _need(set(case["requires"]) <= set(CAPABILITIES), f"{name}: requires {case['requires']}")
    _keys(f"{name}: source", case["source"], {"generator", "basis", "basis_sha256", "spectra"})
    _keys(f"{name}: inputs", case["inputs"], INPUTS[stage], MAY.get(stage, ()))
    for shot in case["inputs"].get("shots", []):
        _keys(f"{name}: shot", shot, {"chart", "white", "dark", "black", "saturation"})
        for frame in ("chart", "white", "dark"):
            if shot[frame] is not None:
                _keys(f"{name}: {frame}", shot[frame], _FULL_FRAME if stage == "verdict" else _FRAME)
    if case["expect"] != "success":
        empty = case["outputs"] is None and case["oracle"] is None and case["truth"] is None and not case["limits"]
        _need(empty, f"{name}: an error has no outputs, oracle, truth or limits")
        return case
    _keys(f"{name}: outputs", case["outputs"], OUTPUTS[stage])
    if case["oracle"] is not None:
        _keys(f"{name}: oracle", case["oracle"], ORACLE)
    if case["truth"] is not None:
        _keys(f"{name}: truth", case["truth"], {"ssf", "measured"})
    _need(bool(case["limits"]), f"{name}: has no limits")
    for limit in case["limits"]:
        _keys(f"{name}: limit", limit, {"value", "against", "metric", "bound", "requires"})
        _need(limit["against"] in AGAINST, f"{name}: compares against {limit['against']!r}")
        _need(limit["metric"] in METRICS, f"{name}: there is no metric {limit['metric']!r}")
        _need(set(limit["requires"]) <= set(CAPABILITIES), f"{name}: limit requires {limit['requires']}")
        _keys(f"{name}: bound", limit["bound"], {"float64"})
        known = case[limit["against"]]
        _need(known is not None and known.get(limit["value"]) is not None, f"{name}: nothing to hold {limit} against")
        _need(not (limit["against"] == "oracle" and limit["value"] == "x"), f"{name}: codes are never compared")
    return case


def read_case(path: Path) -> Json:
    """Read and check one case."""
    try:
        case: Json = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise GoldenError(f"{path.name}: not readable as JSON ({error})") from error
    _need(isinstance(case, dict), f"{path.name}: is no object")
    check(case)
    _need(case["case"] == f"{path.parent.name}/{path.stem}", f"{path.name}: calls itself {case['case']}")
    return case


def paths() -> list[Path]:
    """All case files, in order."""
    return sorted((ROOT / "cases").glob("*/*.json"))


def digest(content: bytes) -> str:
    """SHA-256, hex."""
    return hashlib.sha256(content).hexdigest()


def generator_digest() -> str:
    """SHA-256 of the sources that write the cases."""
    text = b"".join(p.name.encode() + b"\0" + p.read_bytes().replace(b"\r\n", b"\n") for p in _sources())
    return digest(text)


def _sources() -> Iterator[Path]:
    yield from sorted(ROOT.glob("*.py"))


def spectra(name: str) -> Json:
    """The content of golden/spectra/<name>.json."""
    return _parsed(_content(f"spectra/{name}.json"))


@lru_cache(maxsize=32)
def _parsed(content: bytes) -> Json:
    parsed: Json = json.loads(content)
    return parsed


def dng(name: str) -> bytes:
    """The bytes of golden/dng/<name>, from the generator's memory or from the file."""
    return _content(f"dng/{name}")


PENDING: dict[str, bytes] = {}
"""Files that the generator has made but not yet written; it writes only after all checks have passed."""


def _content(name: str) -> bytes:
    return PENDING[name] if name in PENDING else (ROOT / name).read_bytes()


def sibling(name: str) -> Json:
    """Another case by its name, from the generator's memory or from the file."""
    return check(_parsed(_content(f"cases/{name}.json")))


def chart(name: str) -> Floats:
    """(24, 681) reflectance."""
    return np.array(spectra("charts")["values"][name], float)


def lamp(name: str) -> Floats:
    """(681,) relative power."""
    return np.ones(WAVELENGTHS.size) if name == "equal-energy" else np.array(spectra("lamps")["values"][name], float)


def modes(names: list[str | None]) -> Floats:
    """(k, q, 681) modes of each shot's kind of lamp, zeros if it has none; linear between the 5-nm nodes."""
    known = [np.array(spectra("modes")["values"][name], float) if name else np.zeros((0, 69)) for name in names]
    found = np.zeros((len(names), max(map(len, known)), WAVELENGTHS.size))
    for shot, own in zip(found, known, strict=True):
        shot[: len(own)] = interpolate(own.T).T
    return found


def camera(name: str) -> Floats:
    """(681, 3) curves, linear between the 5-nm nodes."""
    return interpolate(np.array(spectra("cameras")["values"][name], float))


def resolve(value: Any) -> Any:
    """The value of an input form (README.md, Input forms): an array, or nested lists if it is ragged."""
    if isinstance(value, dict):
        return _form(value)
    if isinstance(value, list):
        try:
            return np.array(_numbers(value), float)
        except ValueError:
            return _numbers(value)  # shots of unequal length, which an error case needs
    return value


def _form(form: Json) -> Any:
    kind = frozenset(form)
    if kind == {"chart", "patches"}:
        return chart(form["chart"])[np.array(form["patches"], int) - 1]
    if kind == {"chart", "mixtures"}:
        table, i = chart(form["chart"]), np.arange(form["mixtures"])
        t = ((37 * i) % 100 / 100.0)[:, None]
        return (1.0 - t) * table[i % 24] + t * table[(7 * i + 5) % 24]
    if kind == {"lamps"}:
        return np.stack([lamp(name) for name in form["lamps"]])
    if kind == {"constant", "shape"}:
        return np.full(form["shape"], _numbers(form["constant"]), float)
    if kind == {"polynomials"}:
        u = (WAVELENGTHS - 550.0) / 170.0
        return np.array([[_horner(mode, u) for mode in shot] for shot in form["polynomials"]], float).reshape(
            len(form["polynomials"]), -1, WAVELENGTHS.size
        )
    if kind == {"modes"}:
        return modes(form["modes"])
    if kind == {"camera"}:
        return camera(form["camera"])
    if kind == {"bells"}:
        return np.stack(
            [sum(h * np.exp(-0.5 * ((WAVELENGTHS - m) / s) ** 2) for h, m, s in c) for c in form["bells"]], axis=1
        )
    if kind == {"case", "output"}:
        return resolve(sibling(form["case"])["outputs"][form["output"]])
    raise GoldenError(f"there is no input form with the keys {sorted(form)}")


def _horner(coefficients: list[float], u: Floats) -> Floats:
    total = np.zeros_like(u)
    for coefficient in reversed(coefficients):
        total = total * u + coefficient
    return total


def _numbers(value: Any) -> Any:
    """The numbers with "NaN" and "Infinity" as floats; JSON has no such numbers."""
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    if isinstance(value, str):
        _need(value in ("NaN", "Infinity", "-Infinity"), f"{value!r} is no number")
        return float(value.replace("Infinity", "inf"))
    return value


def _keys(where: str, found: Any, needed: set[str], optional: Collection[str] = ()) -> None:
    _need(isinstance(found, dict), f"{where} is no object")
    unknown, missing = set(found) - needed - set(optional), needed - set(found)
    _need(not unknown and not missing, f"{where}: unknown {sorted(unknown)}, missing {sorted(missing)}")


def _need(holds: bool, message: str) -> None:
    if not holds:
        raise GoldenError(message)
