"""Curves + lamp → a Common LUT Format file, version 3 (Academy S-2014-006): camera RGB to ACES2065-1."""

from __future__ import annotations

import xml.etree.ElementTree as Tree

from camssf.exports.curves import Curves
from camssf.exports.matrices import Matrices


def clf(curves: Curves, found: Matrices) -> str:
    """The file's text: one matrix, every digit kept."""
    root = Tree.Element("ProcessList", id=f"urn:sha256:{curves.sha256}", name=curves.camera, compCLFversion="3")
    for tag, text in (
        ("Description", curves.description),
        ("InputDescriptor", f"{curves.camera}, linear raw RGB under {found.lamp}, white 1 1 1"),
        ("OutputDescriptor", "ACES2065-1"),
    ):
        Tree.SubElement(root, tag).text = text
    node = Tree.SubElement(root, "Matrix", inBitDepth="32f", outBitDepth="32f")
    rows = "\n".join(" ".join(map(repr, row)) for row in found.to_aces.tolist())
    Tree.SubElement(node, "Array", dim="3 3").text = f"\n{rows}\n"
    Tree.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Tree.tostring(root, encoding="unicode")}\n'
