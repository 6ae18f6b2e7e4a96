"""Lists in words what an answer assumes about its capture."""

from __future__ import annotations

from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot
from camssf.photo.signals import Assumption
from camssf.recovery.sensitivity import EstimatedLamp, Ssf
from camssf.recovery.unnamed_light import NAMED
from camssf.spectra import Called, Lamp, Light, read_lamp
from camssf.spectra.lamps import TORCH
from camssf.verdict.processed import colours_mixed

LEFT_OUT = (
    "patch {} was left out: it does not match the chart's table. Look for dirt, a reflection or a finger on it."
)
UNCHECKED = "whether a program has mixed the colours of the samples was not checked: noise or samples do not suffice."


def assume(capture: Capture, ssf: Ssf, level: Floats, left_out: int | None) -> tuple[Assumption, ...]:
    """The answer's assumptions, apart from the fallbacks of Eq. (5).

    Args:
        capture, ssf: what was solved, and the answer.
        level: (k, n) 1 - ĥ.
        left_out: 0-based, the patch that was left out of the fit, if one did not match its table.
    """
    table = capture.chart
    public = f"{table.source} ({table.table}), not measured on this chart."
    own = f"those of {table.source}, taken for this chart's own."
    assumptions = [Assumption("chart_table", f"the chart's reflectances are {public if table.public else own}")]
    if left_out is not None:
        assumptions.append(Assumption("patch_left_out", LEFT_OUT.format(table.patches[left_out])))
    for j, shot in enumerate(capture.shots):
        where = f"shot {j + 1}: " if len(capture.shots) > 1 else ""
        light = ssf.lights[j] if ssf.lights else None
        assumptions.append(Assumption("lamp", where + _light(shot.lamp, light)))
        assumptions += _uneven(where, shot, ssf, level[j])
        named_levels = {
            frame.levels: frame.name for frame in (shot.photo, shot.white, shot.dark) if frame and frame.levels
        }
        assumptions += [
            Assumption("raw_levels", where + _levels(name, whose)) for whose, name in named_levels.items()
        ]
        if shot.photo.matrices_left_out:
            words = f"{shot.photo.name}: {shot.photo.matrices_left_out}."
            assumptions.append(Assumption("colour_matrix", where + words))
        if shot.photo.gain_map:
            assumptions.append(Assumption("lens_shading", where + _shading(shot)))
        if shot.means.noise is not None and colours_mixed(shot.means) is None:
            assumptions.append(Assumption("mixing_unchecked", where + UNCHECKED))
    if capture.shots[0].means.white is not None and capture.white_reflectance is None:
        assumptions.append(Assumption("white_reference", "the white frame's target has reflectance 1."))
    if ssf.std is None:
        assumptions.append(Assumption("no_band", "the paper's basis has no prior, so the result has no error bands."))
    return tuple(assumptions)


def _light(lamp: Light, light: EstimatedLamp | None) -> str:
    """Describes a light as it was named, called, or estimated."""
    if light is not None:
        return (
            f"the light was {called_in_words(lamp.name, light)}."
            if isinstance(lamp, Called)
            else _unnamed(lamp.name, light)
        )
    lamp = read_lamp(lamp.name) if isinstance(lamp, Called) else lamp  # on a basis that weighs no lamps
    assert isinstance(lamp, Lamp)
    return (
        f"the light was {lamp.name} ({lamp.source}), smooth relative tolerance "
        f"{lamp.tolerance:.1%}, {len(lamp.modes)} mode(s)."
    )


def _uneven(where: str, shot: MeasuredShot, ssf: Ssf, level: Floats) -> list[Assumption]:
    """Describes how even the light was, and how that was found."""
    if not ssf.gain_code.size:
        flat = "the light was the same all over the chart."
        return [] if shot.means.white is not None else [Assumption("uneven_light", where + flat)]
    if shot.means.white is not None:
        return [Assumption("uneven_light", f"{where}the light on each patch was estimated together with the curves.")]
    least, most = 100.0 / level.max() - 100.0, 100.0 / level.min() - 100.0
    return [
        Assumption(
            "uneven_light",
            f"{where}the unevenness of the light was estimated together with the curves: {least:+.0f} % to "
            f"{most:+.0f} % on the patches relative to the white one, almost the same for the three channels.",
        )
    ]


SINGULAR = {"daylight": "daylight", "bulb": "bulb", "white-led": "white LED", "fluorescent": "fluorescent lamp"}
"""One lamp of each kind."""


def called_in_words(name: str, light: EstimatedLamp) -> str:
    """What a light was called, and what it is by the signals."""
    kelvin = f"{light.kelvin:,.0f} ± {light.kelvin_std:,.0f} K"
    if NAMED not in light.kinds:  # called by its kind: nothing else was possible
        return f"called {name}; by the signals {kelvin}"
    table = light.kinds[NAMED]
    (kind, share), *_ = sorted(
        ((kind, share) for kind, share in light.kinds.items() if kind != NAMED), key=lambda pair: -pair[1]
    )
    if table > share:
        return f"called {name}; by the signals {name} itself ({table:.0%}) or another {SINGULAR[kind]}"
    return f"called {name}; by the signals another {SINGULAR[kind]} of {kelvin} ({share:.0%})"


def _unnamed(name: str, light: EstimatedLamp) -> str:
    """Describes a light that was estimated from the signals."""
    kelvin = f"{light.kelvin:.0f} ± {light.kelvin_std:.0f} K."
    if name == TORCH:
        return f"the light was the phone's torch, a white LED, and was estimated from the signals: {kelvin}"
    likely = sorted(light.kinds.items(), key=lambda each: -each[1])
    kinds = ", ".join(f"{kind} {probability:.0%}" for kind, probability in likely)
    return (
        f"the light was not named and was estimated from the signals: {kinds}, "
        f"{kelvin} All kinds have the same prior probability; other kinds of light and mixtures of two are not "
        "considered."
    )


def _levels(name: str, whose: str) -> str:
    """Describes raw levels that come from another file, for a file that does not state its own."""
    return (
        f"{name} is not a DNG: its colour pattern, black level and white level come from {whose}. A wrong level "
        "changes every signal; a dark frame makes the black level unnecessary."
    )


def _shading(shot: MeasuredShot) -> str:
    """Describes how the lens-shading map in a shot's file was used."""
    map_of = f"{shot.photo.name} holds a lens-shading map;"
    if shot.lens_shading == "apply":
        return f"{map_of} it was applied to the patches' signals" + (
            " of every frame, so that it cancels against the white frame." if shot.white else "."
        )
    rest = ", the white frame corrects the shading." if shot.white else " and no white frame corrects it."
    return f"{map_of} it was not applied{rest}"
