"""Commands on many results: batch, registry, passports."""

from camssf_fleet.cli.batch import batch
from camssf_fleet.cli.passport import passport
from camssf_fleet.cli.registry import registry
from camssf_fleet.cli.upkeep import COMMANDS as UPKEEP

for _upkeep, _example in UPKEEP:
    registry.command(epilog=f"Example: {_example}")(_upkeep)

COMMANDS = ((batch, "camssf batch manifest.csv -o out/ --workers 2"), (passport, ""), (registry, ""))
"""Each command with an example for its help, and the groups of commands."""
