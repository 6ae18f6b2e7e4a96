"""Each prints a number that stands in the docs, beside the command."""
