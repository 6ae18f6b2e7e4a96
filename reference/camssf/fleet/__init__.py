"""Batches of many cameras, and the registry of their results."""
