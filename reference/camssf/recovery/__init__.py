"""Recovers curves from signals, with error bands and duality gaps. Does not depend on `camssf.photo`."""

from camssf.recovery.basis import read_basis
from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import LampGuess, recover
from camssf.recovery.linear_rows import LinearRows, linear_rows
from camssf.recovery.observation import Observation
from camssf.recovery.prediction import Prediction, predict
from camssf.recovery.sensitivity import SolverSettings, Ssf, predict_signals

__all__ = [
    "LampGuess",
    "LinearRows",
    "Observation",
    "Prediction",
    "SolverSettings",
    "Ssf",
    "explain",
    "linear_rows",
    "predict",
    "predict_signals",
    "read_basis",
    "recover",
]
