"""Finds the chart in a small picture: its corners, orientation and confidence; Kotlin has the same algorithm.

`camssf.photo.find.candidates.find_candidates` runs four steps: `picture` (any picture as whole numbers), `blobs`
(shapes that look like a patch), `lattices` (regular arrangements of blobs), and orientation (which is the
first patch).
"""
