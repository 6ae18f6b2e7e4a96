"""Recovers curves from signals, with error bands and duality gaps. Does not depend on `camssf.photo`."""

from camssf.recovery.budget import explain
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.prediction import Prediction, predict
from camssf.recovery.sensitivity import SolverSettings, Ssf, predict_signals

__all__ = ["Observation", "Prediction", "SolverSettings", "Ssf", "explain", "predict", "predict_signals", "recover"]
