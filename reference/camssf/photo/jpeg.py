"""A stored JPEG → sound or not, from its first and last bytes: LibRaw decodes it."""

from __future__ import annotations

import struct

from camssf.errors import UnsupportedRaw
from camssf.photo.tags import CONVERT, Tiff


def check_jpeg(tiff: Tiff, at: int, count: int, samples: int) -> None:
    """Raise unless the bytes at `at` are a JPEG that can be read.

    Only a whole lossless JPEG (ITU-T T.81, SOF3) of just so many samples passes, in a form that LibRaw decodes.

    LibRaw takes damage inside the coded samples in silence, and so it passes here. After a restart it goes on
    predicting from the line above, which only predictor 1 forgives, and it knows no point transform.

    Raises:
        UnreadableRaw: it is damaged.
        UnsupportedRaw: a form that LibRaw does not decode.
    """
    some = min(count, 4096)
    head, tail = tiff.bytes_at(at, some), tiff.bytes_at(at + count - some, some)
    if head[:2] != b"\xff\xd8" or b"\xff\xd9" not in tail:  # begin and end of image; padding may follow
        raise tiff.damaged("a tile is no whole JPEG")
    place, restart, framed = 2, 0, False
    while place + 4 <= len(head) and head[place] == 0xFF:
        marker, length = struct.unpack_from(">xBH", head, place)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            if marker != 0xC3:
                raise UnsupportedRaw(f"{tiff.file} is compressed with lossy JPEG.", CONVERT)
            if place + 10 > len(head):
                break
            precision, lines, columns, components = struct.unpack_from(">BHHB", head, place + 4)
            if lines * columns * components != samples or not 2 <= precision <= 16:
                raise tiff.damaged(f"a JPEG of {columns} × {lines} × {components} in a tile of {samples} samples")
            framed = True
        elif marker == 0xDD and place + 6 <= len(head):
            restart = int(struct.unpack_from(">H", head, place + 4)[0])
        elif marker == 0xDA and framed and place + 2 + length <= len(head) and length >= 6:
            predictor, _, transform = head[place + length - 1 : place + length + 2]
            if transform & 15 or (restart and predictor != 1):
                raise UnsupportedRaw(
                    f"{tiff.file} stores lossless JPEG with "
                    + (f"predictor {predictor} and restart intervals." if restart else "a point transform."),
                    CONVERT,
                )
            return
        place += 2 + length
    raise tiff.damaged("a tile's JPEG has no header")
