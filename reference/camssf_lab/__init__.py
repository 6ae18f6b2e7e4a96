"""Simulated photos, direct measurement of curves, and learning of bases."""
