"""Writes a Common LUT Format file, version 3 (Academy S-2014-006): camera RGB under a lamp to ACES2065-1."""

from __future__ import annotations

import xml.etree.ElementTree as Tree
from uuid import NAMESPACE_URL, uuid5

from camssf.exports.curves import ExportedCurves
from camssf.exports.matrices import Matrices


def clf(curves: ExportedCurves, matrices: Matrices) -> str:
    """The file's text: one matrix, every digit kept."""
    rows = "\n".join(" ".join(map(repr, row)) for row in matrices.to_aces.tolist())
    source = f"{curves.camera}, linear raw RGB under {matrices.lamp}, white 1 1 1"
    # one result gives one file per lamp, each with its own id
    uuid = uuid5(NAMESPACE_URL, f"urn:camssf:clf:{curves.sha256}:{matrices.lamp}:{rows}").urn
    root = Tree.Element("ProcessList", id=uuid, name=f"{curves.camera} to ACES2065-1", compCLFversion="3")
    for tag, text in (
        ("Description", f"{source}, to ACES2065-1."),
        ("Description", curves.description),
        ("InputDescriptor", source),
        ("OutputDescriptor", "ACES2065-1"),
    ):
        Tree.SubElement(root, tag).text = text
    node = Tree.SubElement(
        root, "Matrix", id="camera-to-aces", name="camera RGB to ACES2065-1", inBitDepth="32f", outBitDepth="32f"
    )
    Tree.SubElement(node, "Description").text = "White stays 1 1 1; adapted by CAT16 from the lamp to ACES's white."
    Tree.SubElement(node, "Array", dim="3 3").text = f"\n{rows}\n"
    Tree.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Tree.tostring(root, encoding="unicode")}\n'
