"""Fits curves to a capture: the fit, its gain modes, cross-validation, scores and uncertainty."""
