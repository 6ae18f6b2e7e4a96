"""Simulated photos and calibrations of them that all tests share, kept in .pytest_cache until the sources change.

Nobody writes to them: a test that changes a file copies it first.
"""

import hashlib
import json
import os
import pickle
import shutil
import time
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from camssf import Options, Result, Shot, __version__, calibrate
from camssf.documents.document import ADVICE, FORMAT, Document, document_bytes
from camssf.documents.forms import HASH, from_plain
from camssf.photo.capture import Capture
from camssf_lab.simulation.frames import Simulation, simulate
from camssf_lab.simulation.scene import Scene

ROOT = Path(__file__).parents[2]
SIZE = (900, 675)
Made = TypeVar("Made")


def photos(lamp: str = "D55", camera: str = "Nikon 5100 (NPL)", seed: int = 3, **scene: Any) -> Simulation:
    """One simulated shot (chart, white and dark frame, truth) of a smaller picture than a camera's."""
    scene = {"size": SIZE} | scene

    def make(folder: Path) -> Simulation:
        return simulate(camera, lamp, folder, scene=Scene(**scene), seed=seed)

    return _kept(("photos", lamp, camera, seed, sorted(scene.items())), make)


def shot(lamp: str = "D55", camera: str = "Nikon 5100 (NPL)", seed: int = 3, **scene: Any) -> Shot:
    """`photos` as what a user gives: the chart's photo with its lamp, white and dark frame."""
    (made,) = photos(lamp, camera, seed, **scene).shots
    return Shot(str(made.chart), lamp, white=str(made.white), dark=str(made.dark))


def calibrated(lamp: str = "D55", camera: str = "Nikon 5100 (NPL)", seed: int = 3, **scene: Any) -> Result:
    """The calibration of `shot` on the basis `cameras`."""
    key = ("calibrated", lamp, camera, seed, sorted(scene.items()))
    return _kept(key, lambda _: calibrate(shot(lamp, camera, seed, **scene), options=Options(basis="cameras")))


def document_of(capture: Capture) -> dict[str, Any]:
    """What `camssf patches` prints, as parsed JSON that a test may change: without the hash of its content."""
    document = json.loads(document_bytes(Document(format=FORMAT, version=__version__, capture=capture)))
    del document[HASH]
    return dict(document)


def capture_in(document: dict[str, Any]) -> Any:
    """The capture of such a document."""
    return from_plain(document, Document, "test.json", ADVICE).capture


@cache
def _state() -> str:
    """Digest of what a capture depends on: sources, data, libraries and the processor's arithmetic."""
    digest = hashlib.sha256(Path(__file__).read_bytes())
    for path in sorted((ROOT / "reference" / "camssf").rglob("*")):
        if path.is_file() and path.suffix != ".pyc":
            digest.update(path.as_posix().encode() + path.read_bytes())
    for name in ("numpy", "scipy", "onnxruntime", "opencv-python-headless", "rawpy", "tifffile"):
        digest.update(version(name).encode())
    for name in ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"):
        digest.update(os.environ.get(name, "").encode() + b";")
    return digest.hexdigest()[:16]


def _kept(key: tuple[object, ...], make: Callable[[Path], Made]) -> Made:
    """What `make` gives, from the cache if it is there. Two workers that make the same write the same bytes."""
    name = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
    folder = ROOT / ".pytest_cache" / "captures" / _state() / name
    kept = folder / "made.pickle"
    if not kept.exists():
        for other in folder.parents[1].glob("*"):
            if time.time() - other.stat().st_mtime > 86400:
                shutil.rmtree(other, ignore_errors=True)
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f"{os.getpid()}.part"
        part.write_bytes(pickle.dumps(make(folder)))
        os.replace(part, kept)
    made: Made = pickle.loads(kept.read_bytes())
    return made
