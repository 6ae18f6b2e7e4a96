"""The paper's page: its words agree with the numbers of the run, of which no camera knew its maker."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from benchmarks.paper import experiments as paper
from benchmarks.paper import gathering
from benchmarks.paper.rivals import TABLE_1, method
from tests.support.pages import text_of

PAPER, TUNED = "l1 on Gaussians (the paper)", "l1 on Gaussians, γ tuned"
PRODUCT, WIENER = "elastic net on cameras (camssf)", "Wiener"
JIANG = "PCA subspace (Jiang 2013, colour-science)"
QR, PINV = "QR with non-negativity", "pseudo-inverse with non-negativity"
NOISES = ("0.0", "0.005", "0.01")
RUN: dict[str, Any] = json.loads(text_of("docs/paper.json"))


@pytest.mark.repository
@pytest.mark.requirement("R-PAPER")
def test_what_the_page_says_in_words_holds() -> None:
    rows = RUN["figure_4"]
    for noise in NOISES[1:]:
        qr, pinv = (rows[f"{name}: wavelengths, clipped"][noise] for name in (QR, PINV))
        assert qr > pinv > 2 * rows[PAPER][noise]
        assert rows[f"{QR}: Gaussians, NNLS"][noise] <= 1.05 * rows[PAPER][noise]
        assert rows[TUNED][noise] <= rows[PAPER][noise]
        assert rows[PRODUCT][noise] == min(row[noise] for row in rows.values())
    quiet = rows[f"{PINV}: wavelengths, NNLS"]["0.0"]
    assert quiet < rows[PAPER]["0.0"]
    families = RUN["rivals"]
    for noise in NOISES[1:]:
        for light in families[PRODUCT][noise]:
            ours, theirs = (families[name][noise][light]["rmse"] for name in (PRODUCT, WIENER))
            assert ours < theirs
            assert theirs < families[JIANG][noise][light]["rmse"]
            assert theirs == min(families[method(name).label][noise][light]["rmse"] for name in TABLE_1)
    for row in RUN["lamps"].values():
        for light in ("A", "LED-B3", "LED-V1", "FL2"):
            assert row["ignored"][light]["rmse"] > 1.5 * row["known"][light]["rmse"]
            assert row["ignored"][light]["rmsre_percent"] < 0.7


@pytest.mark.repository
@pytest.mark.requirement("R-PAPER")
def test_the_run_was_whole_and_its_bars_hold() -> None:
    assert [bar["bar"] for bar in RUN["bars"] if not bar["met"]] == []
    assert (RUN["every"], RUN["cameras"]) == (1, 54)


@pytest.mark.full
def test_cameras_learn_nothing_of_their_maker() -> None:
    every = paper.cameras()
    assert len(every) == 54
    for camera in every:
        scaled = camera.curve[::10] / camera.curve[::10].max(axis=0)
        assert np.abs(camera.training - scaled).max(axis=(1, 2)).min() > 0.01, camera.name
    nikon = next(camera for camera in every if camera.name == "Nikon 5100 (NPL)")
    assert nikon.maker == "nikon"
    assert len(nikon.training) == 52 - sum(c.maker == "nikon" and not c.name.endswith("(NPL)") for c in every)


@pytest.mark.full
def test_one_camera_through_two_experiments() -> None:
    """Wavelengths by QR are far off; of a lamp that is ignored the curves know, and RMSRE does not."""
    fig = gathering.gather_figure_4({4: paper.run("figure_4", 4)})
    assert fig[f"{QR}: wavelengths, clipped"]["0.005"] > 2 * fig[PAPER]["0.005"]
    row = gathering.gather_lamps({4: paper.run("lamps", 4)})[PAPER]
    assert row["ignored"]["A"]["rmse"] > 1.5 * row["known"]["A"]["rmse"]
    assert row["ignored"]["A"]["rmsre_percent"] < 3.0
