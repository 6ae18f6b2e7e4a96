"""Converts raw signals to CIE XYZ, Lab and reflectance with their covariance, from a camera's curves and a lamp.

Each public name is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from camssf.lazy_names import lazy_names

if TYPE_CHECKING:
    from camssf.colorimetry import KINDS as KINDS
    from camssf.colorimetry import Transform as Transform
    from camssf.colorimetry import adapt as adapt
    from camssf.colorimetry import choose as choose
    from camssf.colorimetry import fit as fit
    from camssf.colorimetry import lab as lab
    from camssf.colorimetry import white_of as white_of
    from camssf_colour.between import Conversion as Conversion
    from camssf_colour.between import Converted as Converted
    from camssf_colour.between import convert as convert
    from camssf_colour.camera import Camera as Camera
    from camssf_colour.camera import ColourCamera as ColourCamera
    from camssf_colour.camera import camera_of_result as camera_of_result
    from camssf_colour.camera import camera_of_ssf as camera_of_ssf
    from camssf_colour.indices import Quality as Quality
    from camssf_colour.indices import quality_of as quality_of
    from camssf_colour.picture import StandardPicture as StandardPicture
    from camssf_colour.picture import WhiteSignal as WhiteSignal
    from camssf_colour.picture import standard_picture as standard_picture
    from camssf_colour.picture import white_of_camera as white_of_camera
    from camssf_colour.picture import white_of_region as white_of_region
    from camssf_colour.picture_file import write_picture as write_picture
    from camssf_colour.reflectance import LitSurfaces as LitSurfaces
    from camssf_colour.reflectance import SurfaceSpectra as SurfaceSpectra
    from camssf_colour.reflectance import spectrum as spectrum
    from camssf_colour.regions import measure_regions as measure_regions
    from camssf_colour.spread import Reference as Reference
    from camssf_colour.standard import PARTS as PARTS
    from camssf_colour.standard import Colours as Colours
    from camssf_colour.standard import of_surfaces as of_surfaces
    from camssf_colour.standard import standard_colour as standard_colour
    from camssf_colour.surface_prior import SurfacePrior as SurfacePrior
    from camssf_colour.surface_prior import prior_of as prior_of
    from camssf_colour.surface_prior import read_prior as read_prior
    from camssf_colour.view import View as View

_HOME = {
    "Camera": "camssf_colour.camera",
    "ColourCamera": "camssf_colour.camera",
    "Colours": "camssf_colour.standard",
    "Conversion": "camssf_colour.between",
    "Converted": "camssf_colour.between",
    "KINDS": "camssf.colorimetry",
    "LitSurfaces": "camssf_colour.reflectance",
    "PARTS": "camssf_colour.standard",
    "Quality": "camssf_colour.indices",
    "Reference": "camssf_colour.spread",
    "StandardPicture": "camssf_colour.picture",
    "SurfacePrior": "camssf_colour.surface_prior",
    "SurfaceSpectra": "camssf_colour.reflectance",
    "Transform": "camssf.colorimetry",
    "View": "camssf_colour.view",
    "WhiteSignal": "camssf_colour.picture",
    "adapt": "camssf.colorimetry",
    "camera_of_result": "camssf_colour.camera",
    "camera_of_ssf": "camssf_colour.camera",
    "choose": "camssf.colorimetry",
    "convert": "camssf_colour.between",
    "fit": "camssf.colorimetry",
    "lab": "camssf.colorimetry",
    "measure_regions": "camssf_colour.regions",
    "of_surfaces": "camssf_colour.standard",
    "prior_of": "camssf_colour.surface_prior",
    "quality_of": "camssf_colour.indices",
    "read_prior": "camssf_colour.surface_prior",
    "spectrum": "camssf_colour.reflectance",
    "standard_colour": "camssf_colour.standard",
    "standard_picture": "camssf_colour.picture",
    "white_of": "camssf.colorimetry",
    "white_of_camera": "camssf_colour.picture",
    "white_of_region": "camssf_colour.picture",
    "write_picture": "camssf_colour.picture_file",
}

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
    "StandardPicture",
    "SurfacePrior",
    "SurfaceSpectra",
    "Transform",
    "View",
    "WhiteSignal",
    "adapt",
    "camera_of_result",
    "camera_of_ssf",
    "choose",
    "convert",
    "fit",
    "lab",
    "measure_regions",
    "of_surfaces",
    "prior_of",
    "quality_of",
    "read_prior",
    "spectrum",
    "standard_colour",
    "standard_picture",
    "white_of",
    "white_of_camera",
    "white_of_region",
    "write_picture",
]

__getattr__, __dir__ = lazy_names(__name__, _HOME)
