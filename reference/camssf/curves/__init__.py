"""Signals → sensing matrix → code → curves, with bands and proof. Knows nothing of photos."""
