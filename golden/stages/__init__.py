"""The stages of the golden vectors, in the order in which they are made; one a file."""

from golden.contract import Stage
from golden.stages import (
    calibrate,
    choice,
    colour,
    finder,
    layers,
    light,
    mosaic,
    patches,
    picture,
    pose,
    regions,
    rivals,
    sensing,
    signals,
    solve,
    spectrum,
    ssf,
    verdict,
    weights,
)

STAGES: dict[str, Stage] = {
    each.STAGE.name: each.STAGE
    for each in (
        mosaic,
        pose,
        patches,
        signals,
        sensing,
        weights,
        solve,
        ssf,
        layers,
        choice,
        calibrate,
        light,
        rivals,
        verdict,
        colour,
        spectrum,
        regions,
        picture,
        finder,
    )
}
