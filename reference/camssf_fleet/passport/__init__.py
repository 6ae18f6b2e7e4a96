"""Signed excerpts of results, keys and revocations."""
