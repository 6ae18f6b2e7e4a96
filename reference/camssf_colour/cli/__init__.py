"""Commands on the colour and the spectrum of surfaces, and on pictures."""

from camssf_colour.cli.colour import colour
from camssf_colour.cli.picture import picture
from camssf_colour.cli.spectrum import spectrum

COMMANDS = (
    (
        colour,
        "camssf colour out/result.json photo.dng --lamp daylight --region 640,480,40,40 --white-region 700,480,40,40",
    ),
    (
        spectrum,
        "camssf spectrum out/result.json photo.dng --lamp daylight --region 640,480,40,40 "
        "--white-region 700,480,40,40 --prior skin",
    ),
    (
        picture,
        "camssf picture out/result.json photo.dng --white-region 700,480,40,40 -o picture.tif",
    ),
)
"""Each command with an example for its help."""
