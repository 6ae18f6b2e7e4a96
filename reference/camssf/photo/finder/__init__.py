"""The chart in a small picture: its corners, which way up, and how sure that is; the same rule in Kotlin.

`camssf.photo.finder.find.find_sightings` does it, over four steps in this order: `picture` (any picture as whole
numbers), `blobs` (what looks like a patch), `lattices` (patches side by side), `naming` (which of them is the first).
"""
