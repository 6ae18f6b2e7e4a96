"""Reads a RAW file: its mosaic and its metadata."""
