"""Turns RAW photos into signals, in four steps: mosaic, pose, patch means, signals. Independent of `recovery`."""
