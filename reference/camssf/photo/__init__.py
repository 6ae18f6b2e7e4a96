"""DNG → mosaic → pose → patch means → signals. Knows nothing of curves."""
