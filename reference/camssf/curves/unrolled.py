"""Sensing matrix → code: unrolled soft thresholding with analytic weights, then an exact finish and its proof.

The problem, one a channel (DESIGN.md, Mathematics 4):

    min over x of  ½ ‖Σ^-½ (b - A x)‖² + ½ λ₂ ‖x‖² + γ ‖x‖₁        (x ≥ 0 where asked)

With H = Aᵀ Σ⁻¹ A, M = H + λ₂ I, g = Aᵀ Σ⁻¹ b this is ½ xᵀ M x - gᵀ x + γ ‖x‖₁ plus a constant.

**The layers.** Split x = z into the quadratic and the l1 part and alternate their proximal steps (Douglas and
Rachford; the same sequence as the over-relaxed ADMM of Boyd et al. 2011, Sec. 6.4). With W = (M + ρ I)⁻¹:

    z ← soft(v, γ / ρ)
    v ← v + α (W g + ρ W (2 z - v) - z)

In LISTA's form (Gregor and LeCun 2010) a layer is x ← soft(W₁ b + W₂ x, θ). Here W₁ = W Aᵀ Σ⁻¹, W₂ = ρ W and
θ = γ / ρ, but the state v keeps what soft() cut away (ADMM's multiplier), so it is an unrolled ADMM, not literally
LISTA: plain LISTA-shaped layers, i.e. ISTA with W₂ = I - M / ‖M‖, are 12 % of the peak off after 20,000 of them on
the paper's basis. ISTA is the case ρ → ‖M‖ without the multiplier; ALISTA (Liu et al. 2019) also takes its weights
from A alone by a closed criterion (coherence), which is useless at a coherence of 0.9999999. The weights here are
analytic in the plain sense: a closed form in A, Σ, λ₂; nothing is trained.

**The finish.** The layers' support and signs start a walk that ends at the exact optimum. Their z solves the
problem exactly for some other g₀ (chosen below); along g(t) = g₀ + t (g - g₀), 0 ≤ t ≤ 1, the optimum is piecewise
linear, and each kink is one pivot of a complementary tableau (Lemke 1965, with bounds on both sides: w = g - M x
must lie in [-γ, γ] and x may leave zero only at such a bound). A good start needs few pivots, a useless one still
arrives: M is positive semidefinite. But a start of more atoms than there are rows has pivots as small as RIDGE: the
tableau then grows to 1 / RIDGE and keeps few digits. The support that such a walk ends at is right, its numbers are
not. So an answer that lacks its proof starts a walk of its own, whose tableau is made of that support alone.

**The proof.** With the residual as dual point the duality gap is

    ½ (1 - α)² (‖r‖² + λ₂ ‖x‖²) + γ ‖x‖₁ - α xᵀ w,     w = Aᵀ Σ⁻¹ r - λ₂ x,  r = b - A x,

α ≤ 1 the largest factor that keeps |α w| ≤ γ. It bounds the distance to the optimum from what is measured, not
from what the solver believes. It is given relative to the objective.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from camssf.curves.sensing import Sensing
from camssf.grid import Floats

DEPTH = 16
GOLDEN = 0.6180339887498949
RELAXATION = 1.6
PIVOT_FLOOR = 1e-12
"""Smallest pivot of a tableau of unit diagonal; atoms closer to dependent than this never serve together."""
REFINEMENTS, EXACT = 8, 1e-10
"""Most steps of the last correction against the residual itself; the share of γ below which it stops as soon as it no
longer halves."""
PROVEN, WALKS = 1e-9, 3
"""A relative duality gap that is proof enough; most walks, each from the answer of the one before, until it is."""
RIDGE = 1e-11
"""Added to the walk's unit diagonal: dependent atoms, of which rounding makes anything, become barely independent.
The refinement and the proof know nothing of it."""


@dataclass(frozen=True)
class Code:
    """The optimum and its proof. First axis: channels R, G, B.

    Attributes:
        values: (3, r) x.
        objective: (3,) of the problem above.
        gap: (3,) relative duality gap.
        unrolled_gap: (3,) the same before the finish.
        pivots: (3,) steps that the finish took.
        precision: (3, r, r) H = Aᵀ Σ⁻¹ A.
    """

    values: Floats
    objective: Floats
    gap: Floats
    unrolled_gap: Floats
    pivots: NDArray[np.int64]
    precision: Floats


def solve(
    sensing: Sensing,
    l2: float,
    gamma: Floats,
    *,
    nonnegative: bool = False,
    depth: int = DEPTH,
    finish: int | None = None,
) -> Code:
    """The code of each channel.

    Args:
        sensing: matrix (3, k n, r), target (3, k n), covariance (3, k n, k n).
        l2: λ₂ ≥ 0.
        gamma: (3,) γ ≥ 0; not 0 where λ₂ = 0.
        nonnegative: x ≥ 0.
        depth: number of layers.
        finish: most pivots of one walk of the finish; 0 for none, None for `finish_steps`.
    """
    steps = finish_steps(sensing.matrix.shape[2]) if finish is None else finish
    codes, objectives, gaps, before, pivots, precisions = [], [], [], [], [], []
    for A, b, sigma, weight in zip(sensing.matrix, sensing.target, sensing.covariance, gamma, strict=True):
        problem = _Problem(*whiten(A, b, sigma), l2, float(weight), nonnegative)
        z = problem.unroll(depth)
        x, taken = problem.finish(z, steps) if steps else (z, 0)
        objective, gap = problem.prove(x)
        codes.append(x)
        objectives.append(objective)
        gaps.append(gap)
        before.append(problem.prove(z)[1])
        pivots.append(taken)
        precisions.append(problem.H)
    return Code(
        np.array(codes),
        np.array(objectives),
        np.array(gaps),
        np.array(before),
        np.array(pivots),
        np.array(precisions),
    )


def finish_steps(atoms: int) -> int:
    """The finish's length: far more pivots than any start has needed."""
    return 8 * atoms + 16


def soft(v: Floats, threshold: float, nonnegative: bool) -> Floats:
    """Soft thresholding: the proximal step of γ‖x‖₁, with x ≥ 0 where asked."""
    shrunk = np.maximum(v - threshold, 0.0)
    return shrunk if nonnegative else shrunk - np.maximum(-v - threshold, 0.0)


def whiten(A: Floats, b: Floats, sigma: Floats) -> tuple[Floats, Floats]:
    """Rows of unit covariance: L⁻¹ A and L⁻¹ b with Σ = L Lᵀ. Half the digits that Σ⁻¹ would cost."""
    L = np.linalg.cholesky(sigma)
    return solve_triangular(L, A, lower=True), solve_triangular(L, b, lower=True)


class _Problem:
    """One channel of whitened rows: min ½ xᵀ M x - gᵀ x + γ ‖x‖₁."""

    def __init__(self, A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> None:
        self.A, self.b, self.l2, self.gamma, self.nonnegative = A, b, l2, gamma, nonnegative
        self.H = A.T @ A
        self.M = self.H + l2 * np.eye(A.shape[1])
        self.g = A.T @ b

    def unroll(self, depth: int) -> Floats:
        """The layers: v → z, `depth` times."""
        r = self.g.size
        rho = self.rho()
        W = np.linalg.inv(self.M + rho * np.eye(r))
        u = W @ self.g
        # g is large where A is, and W keeps only the digits that its condition leaves: one step on the residual.
        W1b, W2 = u + W @ (self.residual(u) - rho * u), rho * W
        v = np.zeros(r)
        for _ in range(depth):
            z = soft(v, self.gamma / rho, self.nonnegative)
            v = v + RELAXATION * (W1b + W2 @ (2.0 * z - v) - z)
        return soft(v, self.gamma / rho, self.nonnegative)

    def rho(self) -> float:
        """Step size: codes are of order 1, so a threshold γ / ρ of order 1 with the l1 part alone suits them."""
        return self.gamma + 2.0 * self.l2

    def residual(self, x: Floats) -> Floats:
        """w = Aᵀ (b - A x) - λ₂ x, from the rows themselves: no cancellation between g and M x."""
        return self.A.T @ (self.b - self.A @ x) - self.l2 * x

    def finish(self, z: Floats, steps: int) -> tuple[Floats, int]:
        """Walk from the layers' z to the optimum, anew from what was found until it is proven; x and all pivots."""
        best, least, taken = z, np.inf, 0
        for turn in range(WALKS):
            walk = self._start(z)
            taken += walk.go(steps)
            z = self._settle(walk)
            gap = self.prove(z)[1]
            if turn == 0 or gap < least:
                best, least = z, gap
            if least <= PROVEN:
                break
        return best, taken

    def _start(self, z: Floats) -> _Walk:
        """The problem of unit diagonal (one tolerance fits all), solved by z for some other g₀."""
        r = z.size
        diagonal = np.diag(self.M)
        self.scale = scale = 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        high = self.gamma * scale
        low = np.full(r, -np.inf) if self.nonnegative else -high
        free = self.gamma == 0 and not self.nonnegative

        tableau = -(self.M * scale * scale[:, None] + RIDGE * np.eye(r))
        support = np.zeros(r, dtype=bool)
        for i in range(r) if free else map(int, np.flatnonzero(z)):
            if -tableau[i, i] > PIVOT_FLOOR:
                tableau = _exchange(tableau, i, i)
                support[i] = True
        x0 = np.where(support, z / scale, 0.0)
        up = z >= 0
        w = self.residual(x0 * scale) * scale
        # Off the support w₀ must lie strictly inside its bounds, each at a depth of its own: ties make walks circle.
        depths = 0.05 + 0.9 * ((np.arange(r) * GOLDEN) % 1.0)
        if self.nonnegative:
            strictly = w - (1.0 + depths) * np.maximum(w - high, 0.0)
        else:
            strictly = np.where(np.abs(w) > high, np.sign(w) * high * depths, w)
        w0 = np.where(support, np.where(up, high, -high), strictly)
        d = w - w0
        slope = np.where(support, 0.0, d) - tableau @ np.where(support, d, 0.0)
        count = np.arange(r)
        return _Walk(
            tableau=np.concatenate([tableau, slope[:, None]], axis=1),
            value=np.where(support, x0, w0),
            lower=np.where(support, np.where(up & (not free), 0.0, -np.inf), low),
            upper=np.where(support, np.where(up | free, np.inf, 0.0), high),
            rows=np.where(support, count, count + r),
            columns=np.append(np.where(support, count + r, count), 2 * r),
            low=low,
            high=high,
            free=free,
        )

    def _settle(self, walk: _Walk) -> Floats:
        """x where the walk ended, refined against the residual itself."""
        r = self.g.size
        inside = walk.rows < r
        x, down = np.zeros(r), np.zeros(r, dtype=bool)
        x[walk.rows[inside]] = walk.value[inside]
        down[walk.rows[inside]] = walk.upper[inside] <= 0
        support = np.isin(np.arange(r), walk.rows[inside])
        inverse = np.zeros((2 * r + 1, 2 * r + 1))
        inverse[np.ix_(walk.rows, walk.columns)] = -walk.tableau
        K = inverse[:r, r : 2 * r]  # of the support's M, since there x moves against w
        x = x * self.scale
        best, smallest = x, np.inf
        for _ in range(REFINEMENTS):
            error = self.residual(x) * self.scale - np.where(down, -walk.high, walk.high)
            error = np.where(support, error, 0.0)
            size = float(np.abs(error).max())
            settled = size <= EXACT * float(walk.high.max()) and size > 0.5 * smallest
            if size < smallest:  # at the limit of the digits each step is a throw of the dice: keep the best
                best, smallest = x, size
            if settled:
                break
            x = x + self.scale * (K @ error)
        x = best
        crossed = (np.where(down, -x, x) < 0) & (not walk.free)
        return np.where(support & ~crossed, x, 0.0)

    def prove(self, x: Floats) -> tuple[float, float]:
        """Objective and relative duality gap of x."""
        r = self.b - self.A @ x
        w = self.residual(x)
        quadratic = float(r @ r + self.l2 * x @ x)
        objective = 0.5 * quadratic + self.gamma * float(np.abs(x).sum())
        worst = float(np.max(w if self.nonnegative else np.abs(w), initial=0.0))
        if self.gamma == 0:  # no ball to scale into: strong convexity bounds the gap by the gradient, ½ ‖w‖² / λ₂
            slope = np.where(x == 0, np.maximum(w, 0.0), w) if self.nonnegative else w
            gap = 0.5 * float(slope @ slope) / self.l2
        else:
            alpha = min(1.0, self.gamma / worst) if worst > 0 else 1.0
            gap = 0.5 * (1 - alpha) ** 2 * quadratic + self.gamma * float(np.abs(x).sum()) - alpha * float(x @ w)
        return objective, max(gap, 0.0) / objective if objective > 0 else 0.0


@dataclass
class _Walk:
    """A tableau on its way from t = 0 to t = 1: rows are basic variables, columns nonbasic ones at a bound.

    Labels: x_i is i, w_i is r + i, t is 2 r. One nonbasic variable, the driver, moves at a time; the first basic one
    that meets a bound leaves for it, and its mate (x_i for w_i, w_i for x_i) drives next.
    """

    tableau: Floats
    value: Floats
    lower: Floats
    upper: Floats
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    low: Floats
    high: Floats
    free: bool

    def go(self, steps: int) -> int:
        """At most so many pivots; how many it took."""
        r = self.value.size
        driver, direction = 2 * r, 1.0
        for taken in range(1, steps + 1):
            start, floor, ceiling = self._range(driver, direction)
            own = ceiling - floor
            q = int(np.flatnonzero(self.columns == driver)[0])
            rate = direction * self.tableau[:, q]
            moves = np.abs(rate) > PIVOT_FLOOR
            room = np.where(rate > 0, self.upper, self.lower) - self.value
            limit = np.where(moves, np.maximum(room / np.where(moves, rate, 1.0), 0.0), np.inf)
            nearest = float(limit.min())
            step = min(nearest, own)
            if not np.isfinite(step):
                return taken  # unbounded: impossible for a convex problem but for rounding; the gap will say so
            self.value = self.value + step * rate
            if own <= nearest:
                if driver == 2 * r:
                    return taken  # t = 1
                driver -= r  # w_i crossed from one bound to the other: x_i leaves zero on that side
                continue
            p = int(np.argmax(np.where(limit <= nearest, np.abs(rate), -1.0)))
            leaving = int(self.rows[p])
            self.tableau = _exchange(self.tableau, p, q)
            self.rows[p], self.columns[q] = driver, leaving
            self.value[p], self.lower[p], self.upper[p] = start + direction * step, floor, ceiling
            if leaving == 2 * r:
                return taken  # t = 1
            driver = leaving + r if leaving < r else leaving - r
            direction = float(np.sign(rate[p]))
        return steps

    def _range(self, driver: int, direction: float) -> tuple[float, float, float]:
        """Where a nonbasic variable starts to move, and its bounds from then on."""
        r = self.value.size
        if driver == 2 * r:
            return 0.0, 0.0, 1.0
        if driver >= r:
            floor, ceiling = float(self.low[driver - r]), float(self.high[driver - r])
            return (floor if direction > 0 else ceiling), floor, ceiling
        if self.free:
            return 0.0, -np.inf, np.inf
        return (0.0, 0.0, np.inf) if direction > 0 else (0.0, -np.inf, 0.0)


def _exchange(tableau: Floats, p: int, q: int) -> Floats:
    """Swap the basic variable of row p with the nonbasic one of column q."""
    pivot = tableau[p, q]
    row, column = tableau[p] / pivot, tableau[:, q] / pivot
    swapped = tableau - np.outer(tableau[:, q], row)
    swapped[p], swapped[:, q] = -row, column
    swapped[p, q] = 1.0 / pivot
    return swapped
