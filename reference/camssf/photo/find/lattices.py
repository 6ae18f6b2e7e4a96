"""Finds lattices: blobs that are neighbours in two directions, and the homography that maps to them.

Sums are written out in a fixed order, without NumPy, so that Kotlin gives the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from camssf.photo.find.blobs import Blob
from camssf.photo.find.chart_colours import limit

NEIGHBOUR: tuple[float, float] = limit("neighbour")
MOST_NEIGHBOURS: int = limit("most_neighbours")
ALIKE: float = limit("alike")
LENGTHS: float = limit("lengths")
COSINE: float = limit("cosine")
STEP: float = limit("step")
FEWEST: int = limit("fewest")
PLACE: list[float] = limit("place")
SIZES: tuple[float, float] = limit("sizes")
WIDEST: int = limit("widest")
FAR: int = limit("far")
BRIDGE: int = limit("bridge")

Matrix = tuple[float, float, float, float, float, float, float, float, float]


@dataclass(frozen=True)
class BlobLattice:
    """A lattice of blobs: the homography from lattice coordinates to px, and the blob's index at each place."""

    map: Matrix
    places: dict[tuple[int, int], int]


def lattices_of(blobs: list[Blob]) -> list[BlobLattice]:
    """All lattices of the blobs, those with most blobs first."""
    near = [_neighbours(blobs, i) for i in range(len(blobs))]
    used: set[int] = set()
    lattices: list[BlobLattice] = []
    for seed in range(len(blobs)):
        if seed in used:
            continue
        basis = _basis(blobs, near[seed], seed)
        if basis is None:
            continue
        grown = _grown(blobs, near, seed, basis, used)
        if len(grown) < FEWEST:
            continue
        lattice = _settled(blobs, grown)
        if lattice is not None:
            used.update(lattice.places.values())
            lattices.append(lattice)
    return sorted(lattices, key=lambda lattice: -len(lattice.places))


def fitted(pairs: list[tuple[float, float, float, float]]) -> Matrix | None:
    """Least-squares homography of (u, v, x, y), centred and scaled; None if they do not determine one."""
    count = float(len(pairs))
    mu = mv = mx = my = 0.0
    for u, v, x, y in pairs:
        mu, mv, mx, my = mu + u, mv + v, mx + x, my + y
    mu, mv, mx, my = mu / count, mv / count, mx / count, my / count
    size = 0.0
    for _, _, x, y in pairs:
        size = max(size, abs(x - mx), abs(y - my))
    if size <= 0.0:
        return None
    normal = [[0.0] * 9 for _ in range(8)]
    for u, v, x, y in pairs:
        p, q, s, t = u - mu, v - mv, (x - mx) / size, (y - my) / size
        for row in (
            (p, q, 1.0, 0.0, 0.0, 0.0, -s * p, -s * q, s),
            (0.0, 0.0, 0.0, p, q, 1.0, -t * p, -t * q, t),
        ):
            for i in range(8):
                for j in range(9):
                    normal[i][j] += row[i] * row[j]
    h = solved(normal)
    if h is None:
        return None
    a, b, c, d, e, f, g, k = h
    # Undo the scaling and centring: x = size · x' + mx, u' = u - mu.
    top = (size * a + mx * g, size * b + mx * k, size * c + mx)
    middle = (size * d + my * g, size * e + my * k, size * f + my)
    low = (g, k, 1.0)
    rows = [(r[0], r[1], r[2] - r[0] * mu - r[1] * mv) for r in (top, middle, low)]
    return (*rows[0], *rows[1], *rows[2])


def solved(system: list[list[float]]) -> list[float] | None:
    """Gaussian elimination with partial pivoting; None if a pivot is practically 0."""
    n = len(system)
    m = [row[:] for row in system]
    for i in range(n):
        pivot = i
        for r in range(i + 1, n):
            if abs(m[r][i]) > abs(m[pivot][i]):
                pivot = r
        m[i], m[pivot] = m[pivot], m[i]
        if abs(m[i][i]) < 1e-12:
            return None
        for r in range(i + 1, n):
            part = m[r][i] / m[i][i]
            for j in range(i, n + 1):
                m[r][j] -= part * m[i][j]
    x = [0.0] * n
    for i in range(n - 1, -1, -1):
        total = m[i][n]
        for j in range(i + 1, n):
            total -= m[i][j] * x[j]
        x[i] = total / m[i][i]
    return x


def mapped(h: Matrix, u: float, v: float) -> tuple[float, float]:
    """(x, y) of (u, v)."""
    w = h[6] * u + h[7] * v + h[8]
    return (h[0] * u + h[1] * v + h[2]) / w, (h[3] * u + h[4] * v + h[5]) / w


def inverse(h: Matrix) -> Matrix:
    """Inverse homography by cofactors, up to its scale."""
    a, b, c, d, e, f, g, k, i = h
    return (
        e * i - f * k, c * k - b * i, b * f - c * e,
        f * g - d * i, a * i - c * g, c * d - a * f,
        d * k - e * g, b * g - a * k, a * e - b * d,
    )  # fmt: skip


def _neighbours(blobs: list[Blob], i: int) -> list[tuple[float, int]]:
    """(squared distance, index) of the nearest blobs that may be adjacent patches."""
    a = blobs[i]
    reach = NEIGHBOUR[1] * a.det
    neighbours = []
    for j, b in enumerate(blobs):
        if j == i or b.area > ALIKE * a.area or a.area > ALIKE * b.area:
            continue
        dx, dy = b.x - a.x, b.y - a.y
        far = a.yy * dx * dx - 2 * a.xy * dx * dy + a.xx * dy * dy
        if NEIGHBOUR[0] * a.det <= far <= reach:
            neighbours.append((far / a.det, j))
    return sorted(neighbours)[:MOST_NEIGHBOURS]


def _basis(blobs: list[Blob], near: list[tuple[float, int]], seed: int) -> tuple[float, float, float, float] | None:
    """The shortest two steps from the seed that are square in its second moments, in clockwise order."""
    a = blobs[seed]
    best, basis = math.inf, None
    for m, (far_j, j) in enumerate(near):
        for far_k, k in near[m + 1 :]:
            if far_j + far_k >= best or far_k > LENGTHS * far_j:
                continue
            px, py, qx, qy = blobs[j].x - a.x, blobs[j].y - a.y, blobs[k].x - a.x, blobs[k].y - a.y
            dot = (a.yy * px * qx - a.xy * (px * qy + py * qx) + a.xx * py * qy) / a.det
            if dot * dot > COSINE * COSINE * far_j * far_k:
                continue
            best = far_j + far_k
            basis = (px, py, qx, qy) if px * qy - py * qx > 0 else (qx, qy, px, py)
    return basis


def _grown(
    blobs: list[Blob],
    near: list[list[tuple[float, int]]],
    seed: int,
    basis: tuple[float, float, float, float],
    used: set[int],
) -> dict[tuple[int, int], int]:
    """Places of unused blobs reached step by step from the seed; each step predicts the next one."""
    places = {(0, 0): seed}
    taken = used | {seed}
    queue = [(0, 0, seed, basis)]
    at = 0
    while at < len(queue):
        u, v, i, (px, py, qx, qy) = queue[at]
        at += 1
        for du, dv in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            if (u + du, v + dv) in places or abs(u + du) > WIDEST or abs(v + dv) > WIDEST:
                continue
            sx, sy = du * px + dv * qx, du * py + dv * qy
            x, y = blobs[i].x + sx, blobs[i].y + sy
            best, chosen = STEP * STEP * (sx * sx + sy * sy), -1
            for _, j in near[i]:
                ex, ey = blobs[j].x - x, blobs[j].y - y
                if j not in taken and ex * ex + ey * ey < best:
                    best, chosen = ex * ex + ey * ey, j
            if chosen < 0:
                continue
            gx, gy = blobs[chosen].x - blobs[i].x, blobs[chosen].y - blobs[i].y
            step = (du * gx, du * gy, qx, qy) if du else (px, py, dv * gx, dv * gy)
            places[(u + du, v + dv)] = chosen
            taken.add(chosen)
            queue.append((u + du, v + dv, chosen, step))
    return places


def _settled(blobs: list[Blob], grown: dict[tuple[int, int], int]) -> BlobLattice | None:
    """Fit one homography to all blobs; each round adds blobs at its places, drops others, and fits again."""
    places, own = grown, set(grown.values())
    low = [min(p[axis] for p in grown) - FAR for axis in (0, 1)]
    high = [max(p[axis] for p in grown) + FAR for axis in (0, 1)]
    h: Matrix | None = None
    for place in PLACE:
        h = fitted([(float(u), float(v), blobs[i].x, blobs[i].y) for (u, v), i in sorted(places.items())])
        if h is None:
            return None
        shares = sorted(blobs[i].area / pitch_area(h, float(u), float(v)) for (u, v), i in places.items())
        usual = shares[len(shares) // 2]
        places = _in_place(blobs, h, (usual, place), (low[0], low[1], high[0], high[1]))
        places = _together(places, own)
        if len(places) < FEWEST:
            return None
    h = fitted([(float(u), float(v), blobs[i].x, blobs[i].y) for (u, v), i in sorted(places.items())])
    return None if h is None else BlobLattice(h, places)


def pitch_area(h: Matrix, u: float, v: float) -> float:
    """Area of one lattice cell at (u, v), px²; never 0."""
    w = h[6] * u + h[7] * v + h[8]
    a, b, c, d, e, f, g, k, i = h
    det = a * (e * i - f * k) - b * (d * i - f * g) + c * (d * k - e * g)
    return max(abs(det / (w * w * w)), 1e-9)


def _in_place(
    blobs: list[Blob], h: Matrix, wanted: tuple[float, float], bounds: tuple[int, int, int, int]
) -> dict[tuple[int, int], int]:
    """The nearest blob at each place of the lattice whose size agrees with the lattice.

    `wanted` is the usual share of a cell's area that a blob fills, and its largest distance from the place.
    """
    usual, place = wanted
    back = inverse(h)
    best: dict[tuple[int, int], tuple[float, int]] = {}
    for i, blob in enumerate(blobs):
        if back[6] * blob.x + back[7] * blob.y + back[8] == 0.0:
            continue
        u, v = mapped(back, blob.x, blob.y)
        if not (bounds[0] <= u <= bounds[2] and bounds[1] <= v <= bounds[3]):
            continue
        if h[6] * u + h[7] * v + h[8] <= 0.0:  # behind the camera
            continue
        p, q = math.floor(u + 0.5), math.floor(v + 0.5)
        off = (u - p) * (u - p) + (v - q) * (v - q)
        if off > place * place:
            continue
        share = blob.area / (usual * pitch_area(h, float(p), float(q)))
        if SIZES[0] <= share <= SIZES[1] and off < best.get((p, q), (math.inf, 0))[0]:
            best[(p, q)] = (off, i)
    return {place: best[place][1] for place in best}


def _together(places: dict[tuple[int, int], int], own: set[int]) -> dict[tuple[int, int], int]:
    """The connected places, by steps of at most `BRIDGE`, that hold most of the lattice's own blobs.

    Other blobs are there by chance, or belong to another lattice.
    """
    most: list[tuple[int, int]] = []
    largest = 0
    left = set(places)
    for start in sorted(places):
        if start not in left:
            continue
        left.discard(start)
        group = [start]
        for u, v in group:  # the loop appends to it
            for du in range(-BRIDGE, BRIDGE + 1):
                for dv in range(-BRIDGE, BRIDGE + 1):
                    other = (u + du, v + dv)
                    if other in left:
                        left.discard(other)
                        group.append(other)
        count = sum(places[place] in own for place in group)
        if count > largest:
            most, largest = group, count
    return {place: places[place] for place in most}
