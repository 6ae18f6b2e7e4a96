"""Converts raw signals to CIE XYZ, Lab and reflectance with their covariance, from a camera's curves and a lamp."""

from __future__ import annotations

from camssf.colour.between import Conversion, Converted, convert
from camssf.colour.camera import Camera, ColourCamera, camera_of_result, camera_of_ssf
from camssf.colour.indices import Quality, quality_of
from camssf.colour.reflectance import LitSurfaces, SurfaceSpectra, spectrum
from camssf.colour.spaces import adapt, white_of
from camssf.colour.spread import Reference
from camssf.colour.standard import PARTS, Colours, standard_colour
from camssf.colour.surface_prior import SurfacePrior, prior_of, read_prior
from camssf.colour.transforms import KINDS, Transform, choose, fit
from camssf.colour.view import View
from camssf.spectra.appearance import lab

__all__ = [
    "KINDS",
    "PARTS",
    "Camera",
    "ColourCamera",
    "Colours",
    "Conversion",
    "Converted",
    "LitSurfaces",
    "Quality",
    "Reference",
    "SurfacePrior",
    "SurfaceSpectra",
    "Transform",
    "View",
    "adapt",
    "camera_of_result",
    "camera_of_ssf",
    "choose",
    "convert",
    "fit",
    "lab",
    "prior_of",
    "quality_of",
    "read_prior",
    "spectrum",
    "standard_colour",
    "white_of",
]
