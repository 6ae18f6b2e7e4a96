"""Signals → sensing matrix → code → curves, with bands and proof. Knows nothing of photos."""

from camssf.curves.budget import explain
from camssf.curves.choice import recover
from camssf.curves.evidence import Evidence
from camssf.curves.predict import Prediction, predict
from camssf.curves.ssf import Ssf, respond

__all__ = ["Evidence", "Prediction", "Ssf", "explain", "predict", "recover", "respond"]
