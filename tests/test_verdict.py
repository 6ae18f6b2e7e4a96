"""The verdict's rules, one fault at a time, on a capture that is accepted without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from camssf.chart import LAYOUTS, Pose
from camssf.grid import Floats
from camssf.patches import FrameMeans, PatchMeans
from camssf.signals import Signals, normalise
from camssf.spectra import ChartTable, read_chart, read_lamp
from camssf.ssf import Ssf, recover
from camssf.verdict import Verdict, judge, refusal
from tests.problems import chart_and_lamp, measured_cameras, theory

TABLE = read_chart("classic24")


def frame(signal: Floats) -> FrameMeans:
    mean = 512.0 + 12000.0 * signal
    zero = np.zeros_like(mean)
    return FrameMeans(mean, 0.002 * (mean - 512) + 1, zero.astype(np.int64) + 400, zero, zero, zero, mean[:, :2])


def pose() -> Pose:
    layout = LAYOUTS["classic24"]
    i = np.arange(24)
    corner = np.stack([i % layout.columns, i // layout.columns], axis=1) * 100.0
    square = np.array([[0, 0], [80, 0], [80, 80], [0, 80]], float)
    patches = corner[:, None] + square
    return Pose("classic24", patches[[0, 5, 23, 18], [0, 1, 2, 3]], patches, 0, "detected", 0.97, ())


def camera() -> Floats:
    return measured_cameras()["Nikon D5100"]


def decide(
    signal: Floats, *, white: bool = True, lamp: str = "D55", table: ChartTable = TABLE, where: Pose | None = None
) -> tuple[Verdict, Signals, Ssf]:
    shot = PatchMeans(
        frame(signal),
        frame(np.ones((24, 3))) if white else None,
        frame(np.zeros((24, 3))),
        np.full(3, 512.0),
        16383.0,
    )
    signals = normalise([shot], table)
    used = signals.used[0]
    _, light = chart_and_lamp(lamp)
    answer = recover(
        signals.values[:, used],
        table.values[used],
        light,
        standard_error=signals.standard_error[:, used],
        chart_tolerance=table.tolerance[used],
        white_reflectance=None if white else table.values[18],
        lamp_tolerance=0.02,
    )
    predicted = theory(table.values, light, answer.values, 1.0 if white else table.values[18])[None]
    answer = replace(answer, predicted=predicted)
    return judge(signals, table, [shot], [where or pose()], [read_lamp(lamp)], answer), signals, answer


def clean(white: bool = True) -> Floats:
    _, lamp = chart_and_lamp("D55")
    return theory(TABLE.values, lamp, camera()) * (1.0 if white else 0.8)


def codes(verdict: Verdict) -> set[str]:
    return {reason.code for reason in verdict.reasons}


@pytest.mark.parametrize("white", [True, False])
def test_a_clean_capture_is_accepted(white: bool) -> None:
    verdict, _, _ = decide(clean(), white=white)
    assert verdict.status == "accepted"
    assert not verdict.reasons


def test_every_reason_says_what_to_do() -> None:
    bad = clean() * np.linspace(1.0, 0.7, 24)[:, None] * 0.05 + 0.05
    verdict, _, _ = decide(bad, where=replace(pose(), score=0.8))
    assert verdict.status == "refused"  # a veil of half the white
    assert refusal(verdict).reasons == verdict.reasons
    for reason in verdict.reasons:
        assert reason.message
        assert reason.advice.endswith(".")
        assert reason.value is not None
        assert reason.threshold is not None


def test_one_wrong_patch_is_named() -> None:
    y = clean()
    y[13] *= 1.6
    verdict, _, _ = decide(y)
    assert codes(verdict) == {"chart_unfit"}
    assert TABLE.patches[13] in verdict.reasons[0].message


def test_residuals_all_over_accuse_the_lamp() -> None:
    verdict, _, _ = decide(clean() * (1 + 0.3 * np.sin(5.0 * np.arange(24)))[:, None])
    assert codes(verdict) == {"lamp_unfit"}


def test_glare() -> None:
    verdict, _, _ = decide(clean() * 0.9 + 0.1)
    assert "glare" in codes(verdict)


def test_fall_off_without_a_white_frame() -> None:
    place = pose().patches.mean(axis=1)
    light = 1.0 - 0.3 * place[:, 0] / place[:, 0].max()
    verdict, _, _ = decide(clean() * light[:, None], white=False)
    assert codes(verdict) == {"uneven_light"}


def test_dark_white() -> None:
    y = clean()
    verdict, signals, answer = decide(y)
    assert verdict.status == "accepted"
    dim = replace(signals, white=signals.dark + 0.05 * (signals.white - signals.dark))
    shot = PatchMeans(frame(y), frame(np.ones((24, 3))), frame(np.zeros((24, 3))), np.full(3, 512.0), 16383.0)
    assert codes(judge(dim, TABLE, [shot], [pose()], [read_lamp("D55")], answer)) == {"underexposed"}


def test_poor_pose_and_wide_bands() -> None:
    y = clean()
    verdict, signals, answer = decide(y, where=replace(pose(), score=0.8))
    assert codes(verdict) == {"chart_unfit"}
    assert answer.std is not None
    vague = replace(answer, std=answer.std * 5)
    shot = PatchMeans(frame(y), frame(np.ones((24, 3))), frame(np.zeros((24, 3))), np.full(3, 512.0), 16383.0)
    assert codes(judge(signals, TABLE, [shot], [pose()], [read_lamp("D55")], vague)) == {"underexposed"}


def test_few_patches() -> None:
    y = clean()
    _, signals, answer = decide(y)
    few = replace(signals, used=signals.used & (np.arange(24) < 9))
    shot = PatchMeans(frame(y), frame(np.ones((24, 3))), frame(np.zeros((24, 3))), np.full(3, 512.0), 16383.0)
    assert codes(judge(few, TABLE, [shot], [pose()], [read_lamp("D55")], answer)) == {"underexposed"}


def test_a_lamp_known_by_kind_alone() -> None:
    _, signals, answer = decide(clean())
    shot = PatchMeans(frame(clean()), frame(np.ones((24, 3))), frame(np.zeros((24, 3))), np.full(3, 512.0), 16383.0)
    for name, expected in (("white-led", {"lamp_unfit"}), ("fluorescent", {"lamp_unfit"}), ("daylight", set())):
        assert codes(judge(signals, TABLE, [shot], [pose()], [read_lamp(name)], answer)) == expected
