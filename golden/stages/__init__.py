"""The stages of the golden vectors: how each is run, its cases and its limits."""

from __future__ import annotations

from golden.contract import Stage
from golden.stages import captures, choice, colour, finder, photos, picture, signals, ssf, verdict

ORDER = (
    *photos.STAGES, signals.STAGE, ssf.STAGE, choice.STAGE, *captures.STAGES, verdict.STAGE,
    colour.STAGE, colour.SPECTRUM, picture.REGION_STAGE, picture.STAGE, finder.STAGE,
)  # fmt: skip
"""A stage follows those whose cases its own name."""
STAGES: dict[str, Stage] = {stage.name: stage for stage in ORDER}
