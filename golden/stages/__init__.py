"""The stages of the golden vectors: how each is run, its cases and its limits."""

from __future__ import annotations

from golden.contract import Stage
from golden.stages import (
    calibrate,
    choice,
    colour,
    finder,
    light,
    mosaic,
    patches,
    picture,
    pose,
    regions,
    rivals,
    signals,
    spectrum,
    ssf,
    verdict,
)

ORDER = (
    mosaic, pose, patches, signals, ssf, choice, calibrate, light, rivals, verdict, colour, spectrum, regions,
    picture, finder,
)  # fmt: skip
"""A stage follows those whose outputs its cases name."""
STAGES: dict[str, Stage] = {module.STAGE.name: module.STAGE for module in ORDER}
