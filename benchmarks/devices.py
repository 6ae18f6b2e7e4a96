"""Measured cameras and phones, each with bases that do not know it, and the error of curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.claim import Run
from benchmarks.shared import CURVES, cameras, standing_in
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.recovery.basis import Basis, interpolate, read_basis
from camssf_lab.learning.basis import learn
from camssf_lab.learning.training import HANDFUL, Enlargement, maker_of, read_curves

SEEN = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
CAMERAS, OTHERS, OTHER_MAKER, PHONES = "cameras", "other phones", "other maker's phones", "phones"
BY_OTHERS, BY_OTHER_MAKER = "phones, basis of the others", "phones, basis of the other maker"
FOREIGN, LEFT_OUT = "another laboratory's cameras", "cameras, maker left out"


@dataclass(frozen=True)
class Device:
    """One measured phone or camera and the bases that it is solved with.

    Attributes:
        name: maker first.
        curves: (681, 3).
        bases: by what they were learned from.
    """

    name: str
    curves: Floats
    bases: Mapping[str, Basis]

    @property
    def maker(self) -> str:
        """As in the files of the device."""
        return maker_of(self.name)

    def known_by(self, key: str) -> Basis:
        """One of its bases under the name of the shipped one that it stands in for."""
        return replace(self.bases[key], name=CAMERAS if key == CAMERAS else PHONES)

    def left_out(self, key: str) -> AbstractContextManager[None]:
        """Within, that basis stands in for the shipped one."""
        return standing_in(self.known_by(key))


@dataclass(frozen=True)
class Population:
    """Devices, and which of their bases stands in for the shipped one."""

    title: str
    devices: Sequence[Device]
    key: str


def taught(nodes: Mapping[str, Floats], names: Sequence[str], size: Enlargement = HANDFUL, label: str = "") -> Basis:
    """The basis of these devices, curves (69, 3) by name."""
    stack = np.stack([nodes[name] for name in names])
    mean, atoms = learn(stack, makers=[maker_of(name) for name in names], size=size)
    return Basis(label, interpolate(mean[..., None])[..., 0], interpolate(atoms), True, ", ".join(names))


def phones_left_out(nodes: Mapping[str, Floats], size: Enlargement = HANDFUL) -> list[Device]:
    """Each phone with `cameras`, the basis of all others, and that of all other makers'."""
    found = []
    for name, curves in nodes.items():
        others = [other for other in nodes if other != name]
        strangers = [other for other in nodes if maker_of(other) != maker_of(name)]
        bases = {
            CAMERAS: read_basis("cameras"),
            OTHERS: taught(nodes, others, size, OTHERS),
            OTHER_MAKER: taught(nodes, strangers, size, OTHER_MAKER),
        }
        found.append(Device(name, interpolate(curves), bases))
    return found


@cache
def learned_without(maker: str) -> Basis:
    """`cameras` learned without one maker's."""
    others = {name: curve for name, curve in read_curves(CURVES).items() if maker_of(name) != maker}
    mean, atoms = learn(np.stack(list(others.values())), makers=[maker_of(name) for name in others])
    return Basis("cameras", interpolate(mean[..., None])[..., 0], interpolate(atoms), True, f"no {maker}")


def left_out() -> tuple[dict[str, Floats], dict[str, Basis]]:
    """Cameras (681, 3) by name, and by maker the basis learned from all others."""
    return cameras(), {maker: learned_without(maker) for maker in sorted(set(map(maker_of, cameras())))}


def measured_cameras() -> list[Device]:
    """The 52 cameras with `cameras`, their maker left out, and `phones`."""
    curves, bases = left_out()
    phones = read_basis("phones")
    return [Device(name, curve, {CAMERAS: bases[maker_of(name)], PHONES: phones}) for name, curve in curves.items()]


def foreign_cameras(path: Path) -> list[Device]:
    """Another laboratory's cameras with both bases as shipped."""
    bases = {CAMERAS: read_basis("cameras"), PHONES: read_basis("phones")}
    return [Device(name, interpolate(curves), bases) for name, curves in read_curves(path).items()]


def populations(run: Run, *titles: str) -> Iterator[Population]:
    """Those of the titles that the run asks for, of cameras every sixth; `Unavailable` if a table is missing."""
    phones: list[Device] = []
    wanted = [title for title in titles if run.wants(title)]
    places = {title: run.named("foreign" if title == FOREIGN else "phones") for title in wanted if title != LEFT_OUT}
    for title in wanted:
        if title == LEFT_OUT:
            yield Population(title, measured_cameras()[::6], CAMERAS)
        elif title == FOREIGN:
            yield Population(title, foreign_cameras(places[title]), CAMERAS)
        else:
            phones = phones or phones_left_out(read_curves(places[title]))
            yield Population(title, phones, OTHERS if title == BY_OTHERS else OTHER_MAKER)


def errors(curves: Floats, std: Floats | None, truth: Floats) -> tuple[Floats, Floats | None]:
    """RMSE (3,) of curves (681, 3) of peak 1, 400 to 700 nm, and where their 95 % bands hold the truth (3, 681)."""
    wrong = (curves - truth / truth.max(axis=0)).T
    rmse = np.sqrt(np.mean(wrong[:, SEEN] ** 2, axis=1))
    return rmse, None if std is None else (np.abs(wrong) <= BAND * std.T).astype(float)


def scored(peak: tuple[Floats, Floats | None], truth: Floats) -> tuple[float, float]:
    """Mean RMSE and coverage, 400 to 700 nm, of curves of peak 1 with bands."""
    rmse, covered = errors(*peak, truth)
    assert covered is not None  # every learned basis has bands
    return float(rmse.mean()), float(covered[:, SEEN].mean())


def no_photo(basis: Basis, truth: Floats) -> float:
    """RMSE of the mean device of a basis, which stands in for this one without any photo."""
    mean = basis.mean.T
    return float(errors(mean / mean.max(axis=0), None, truth)[0].mean())
