"""The version of camssf, written into every document."""

__version__ = "0.1.0"
