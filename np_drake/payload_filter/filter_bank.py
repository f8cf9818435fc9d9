"""Bank of pendulums of different lengths under a vehicle: priors, one filter step, and their
weights.

Each member tracks a tether that it takes to be of its own length, or a vehicle that carries
nothing, in one of some conditions: calm, gusty air, or a payload that is being pushed (`kernel`).
Conditions change, so that members of one length interact; lengths do not, and their weights are
those of Bayes with a small chance of a change. Where no member explains a sample, the payload was
attached, lost or snapped taut: what is known of it is then forgotten.
"""

import numpy as np

from np_drake.compiled import finite
from np_drake.payload_filter import kernel
from np_drake.payload_filter.bank_options import NO_MASS, BankOptions
from np_drake.payload_filter.kernel import mix_bank, weigh_bank
from np_drake.residual_model import Memory


def carries(members: int, conditions: int) -> np.ndarray:
    """Return which of a bank's members carry a payload, (k,) of bool: the last of each condition
    does not.
    """
    count = members // conditions
    return np.tile(np.arange(count) < count - 1, conditions)


class PendulumBank:
    """Filter of all members; arrays of `memory` are the caller's.

    Args:
        step: between samples [s].
        gravity: [m/s²].
    """

    def __init__(self, options: BankOptions, *, step: float, gravity: float):
        o = self.options = options
        self.step = step
        self.gravity = gravity
        # The length of a member without a payload means nothing: the geometric mean of the others
        bare = float(np.exp(np.mean(np.log(o.lengths))))
        lengths = (*o.lengths, bare)
        kinds = len(o.push)
        self.lengths = np.tile(np.array(lengths, float), kinds)
        condition = np.repeat(np.arange(kinds), len(lengths))
        loaded = carries(len(self.lengths), kinds)
        count = len(self.lengths)
        self._reach = np.sqrt(gravity / self.lengths)  # rate of a swing over its angle [1/s]
        # Probability of each member before any flight, (k,)
        self._first_weight = np.where(loaded, (1 - o.bare) / loaded.sum(), o.bare / (~loaded).sum())
        # Prior mean and standard deviation of the parameters, (k, 8)
        self._prior = np.zeros((count, 8))
        self._deviation = np.empty((count, 8))
        self._prior[:, 0] = np.where(loaded, o.mass.mean, NO_MASS.mean)
        self._prior[:, 1] = np.log(self.lengths)
        self._prior[:, 2] = o.damping.mean
        self._prior[:, 6] = o.thrust_error.mean
        self._prior[:, 7] = o.drag.mean
        self._deviation[:, 0] = np.where(loaded, o.mass.deviation, NO_MASS.deviation)
        self._deviation[:, [1, 2]] = o.log_length, o.damping.deviation
        push = np.array(o.push)
        self._deviation[:, 3:6] = push[condition][:, None] * [1.0, 1.0, o.vertical]
        self._deviation[:, [6, 7]] = o.thrust_error.deviation, o.drag.deviation
        # Share of the distance to the prior that a parameter keeps in a step, (k, 8)
        keep = np.tile(np.exp(-step / np.array(o.memory))[condition][:, None], (1, 8))
        keep[:, 3:6] = np.exp(-step / np.array(o.push_time)[condition])[:, None]
        # Variance that a step adds, (k, SIZE): the parameters keep their prior deviation
        swing = np.array(o.swing_noise)[condition] * step / self.lengths**2
        noise = np.zeros((count, kernel.SIZE))
        noise[:, 2:4] = swing[:, None]
        noise[:, 4:] = (1 - keep**2) * self._deviation**2
        self._dynamics = kernel.Dynamics(float(step), self._prior, keep, noise)
        self._rise = (push * o.vertical) ** 2  # variance of the slow force upwards, (3,) [m²/s⁴]
        # Probability of a change from one condition to another in a step, (3, 3)
        leave = 1 - np.exp(-step / np.array(o.duration))
        self._transition = np.tile(leave[:, None] / (kinds - 1), (1, kinds))
        np.fill_diagonal(self._transition, 1 - leave)

    def initial_memory(self) -> Memory:
        """Return a tether that hangs still, with all parameters at their prior.

        mean: (k, POINT).   covariance: (k, SIZE, SIZE).   weight: (k,) [1].
        """
        mean = np.zeros((len(self.lengths), kernel.POINT))
        mean[:, 2] = -1.0
        mean[:, 3] = 1.0
        mean[:, kernel.PARAMETERS] = self._prior
        covariance = np.zeros((len(self.lengths), kernel.SIZE, kernel.SIZE))
        diagonal = np.arange(kernel.SIZE)
        covariance[:, diagonal[:2], diagonal[:2]] = self.options.tilt**2
        covariance[:, diagonal[2:4], diagonal[2:4]] = (
            self.options.tilt * self._reach[:, None]
        ) ** 2
        covariance[:, diagonal[4:], diagonal[4:]] = self._deviation**2
        weight = self._first_weight.copy()
        return {"mean": mean, "covariance": covariance, "weight": weight}

    def step_on(
        self,
        memory: Memory,
        drive: np.ndarray,
        now: np.ndarray,
        label: np.ndarray,
        variance: np.ndarray,
    ) -> Memory:
        """Return the memory after one step and one label; it starts anew where numbers overflow.

        Args:
            drive: (9,) as of `kernel.filter_bank`.
            now: (9,) likewise.
            label: (3,) force per mass, NaN where there is none [m/s²].
            variance: (3,) of its noise [m²/s⁴].
        """
        mean, covariance, weight = mix_bank(
            memory["mean"], memory["covariance"], memory["weight"], self._transition, self._rise
        )
        predicted, spread, updated, narrowed, likelihood, distance = kernel.filter_bank(
            mean, covariance, drive, now, self._dynamics, kernel.Label(label, variance)
        )
        if not finite(label):
            return {"mean": predicted, "covariance": spread, "weight": weight}
        if not distance.min() < self.options.jump:
            return self._anew(predicted, spread)
        if not (finite(updated) and finite(narrowed)):
            return self.initial_memory()
        weight = weigh_bank(
            weight,
            likelihood,
            updated,
            self._prior,
            self._deviation,
            self._first_weight,
            float(np.exp(-self.step * self.options.change)),
        )
        return {"mean": updated, "covariance": narrowed, "weight": weight}

    def _anew(self, mean: np.ndarray, covariance: np.ndarray) -> Memory:
        """Return the memory after a sample that no member explains: payload and swing are
        forgotten, what belongs to the vehicle stays, and the sample itself is not taken in.

        A jerk of the cable tells nothing of the payload's mass. A change that lasts shows in the
        next sample.
        """
        if not (finite(mean) and finite(covariance)):
            return self.initial_memory()
        covariance[:, :7, :] = 0.0
        covariance[:, :, :7] = 0.0
        deviation = np.empty((len(self.lengths), 7))
        deviation[:, :2] = self.options.lost_tilt
        deviation[:, 2:4] = (self.options.lost_tilt * self._reach)[:, None]
        deviation[:, 4:] = self._deviation[:, :3]
        rows = np.arange(7)
        covariance[:, rows, rows] = deviation**2
        mean[:, kernel.MASS : kernel.DAMPING + 1] = self._prior[:, :3]
        return {"mean": mean, "covariance": covariance, "weight": self._first_weight.copy()}
