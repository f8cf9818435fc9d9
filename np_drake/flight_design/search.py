"""Search for the motion of most information: random draws, then local refinement, with a fixed seed and budget."""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake.flight_design.limits import Limits, largest
from np_drake.flight_design.motion import Basis, DesignedMotion
from np_drake.flight_design.naive import RATE, coefficient_scale, random_coefficients

FIRST = 0.25  # share of the budget for random draws [1]
FACTORS = 0.5  # share of the steps of the refinement that multiply [1]
CHANGED = 0.25  # share of the coefficients that a step of the refinement changes [1]
STEP, LONGER, SHORTER, SHORTEST = 0.4, 1.5, 0.9, 0.02  # of the refinement, relative to the natural size [1]
Value = Callable[[DesignedMotion], float]


@dc.dataclass(frozen=True)
class Search:
    """Random search and refinement of motions within limits.

    A motion is always as large as the limits allow, so that its shape alone is sought. The refinement is a (1+1)
    evolution strategy with a step that grows on success and shrinks on failure.
    Source: Rechenberg, I.: Evolutionsstrategie, 1973; own choice: steps in a random part of the coefficients.

    share: of the limits that may be used [1].   evaluations: of the value.   seed: of all draws.
    """

    limits: Limits
    basis: Basis
    share: float
    evaluations: int = 240
    seed: int = 0

    def best(
        self,
        value: Value,
        starts: Sequence[np.ndarray] = (),
        tell: Callable[[float], None] | None = None,
        enough: float = np.inf,
    ) -> tuple[DesignedMotion, float]:
        """Return the motion of the largest value, and that value.

        Args:
            value: of a motion; the larger the better.
            starts: coefficients (q, 3) of motions to begin with.
            tell: called with the share done [1].
            enough: value at which the search ends.
        """
        rng = np.random.default_rng(self.seed)
        draws = max(1, round(FIRST * self.evaluations) - len(starts))
        first = [*starts, *(random_coefficients(rng, self.basis, self.limits) for _ in range(draws))]
        best, most, step = self.sized(first[0]), -np.inf, STEP
        for k in range(self.evaluations):
            motion = self.sized(first[k] if k < len(first) else self._moved(best.coefficients, step, rng))
            found = value(motion)
            if k >= len(first):
                step = step * LONGER if found > most else max(SHORTEST, step * SHORTER)
            if found > most:
                best, most = motion, found
            if tell is not None:
                tell(1.0 if most >= enough else (k + 1) / self.evaluations)
            if most >= enough:
                break
        return best, most

    def _moved(self, coefficients: np.ndarray, step: float, rng: np.random.Generator) -> np.ndarray:
        """Return changed coefficients: some by additions, or a block of an axis by a factor."""
        scale = coefficient_scale(self.basis, self.limits)
        if rng.random() < FACTORS:
            gain = np.exp(2 * step * rng.standard_normal((self.basis.blocks[-1] + 1, 3)))
            gain = np.where(rng.random(gain.shape) < CHANGED, gain, 1.0)
            return coefficients * gain[self.basis.blocks]
        changed = rng.random(scale.shape) < CHANGED
        size = float(np.sqrt(np.mean((coefficients / scale) ** 2)))
        return coefficients + changed * step * size * scale * rng.standard_normal(scale.shape)

    def sized(self, coefficients: np.ndarray) -> DesignedMotion:
        """Return the motion of this shape that is as large as the limits allow."""
        stride = max(1, round(1.0 / (RATE * self.basis.step)))
        t, flat = self.basis.t[::stride], self.basis.flat[:, ::stride] @ coefficients

        def used(size: float) -> float:
            scaled = size * flat
            scaled[0] += self.limits.center
            return max(self.limits.usage(t, scaled).values())

        return DesignedMotion(self.basis, self.limits.center, largest(used, 1.0, self.share) * coefficients)


def projected(basis: Basis, flat: np.ndarray) -> np.ndarray:
    """Return the coefficients (q, 3) of the basis nearest to a motion flat (5, n, 3) at its times.

    Nearest in velocity, so that slow and fast parts count alike.
    """
    return np.linalg.lstsq(basis.flat[1], flat[1], rcond=None)[0]
