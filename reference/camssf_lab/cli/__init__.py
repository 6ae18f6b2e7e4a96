"""Commands that simulate photos and that measure curves directly."""

from camssf_lab.cli.direct import direct
from camssf_lab.cli.simulate import simulate

COMMANDS = (
    (simulate, "camssf simulate --lamp D55 --size 1800x1350 -o shots/"),
    (direct, "camssf direct rgb.dng mono.tif --dark dark.dng --response mono.csv -o out/"),
)
"""Each command with an example for its help."""
