"""Bank of pendulums of different lengths under a vehicle: priors, one filter step, and their
weights.

Each member tracks a tether that it takes to be of its own length, or a vehicle that carries
nothing, in one of three conditions: calm, gusty air, or a payload that is being pushed (`kernel`).
Conditions change, so that members of one length interact; lengths do not, and their weights are
those of Bayes with a small chance of a change. Where no member explains a sample, the payload was
attached, lost or snapped taut: what is known of it is then forgotten.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.compiled import finite
from np_drake.payload_filter import kernel
from np_drake.payload_filter.kernel import mix_bank, weigh_bank
from np_drake.residual_model import Memory
from np_drake.vehicle.scaling import Scales

CONDITIONS = ("calm", "gusty", "pushed")
# Powers of length and time in the unit of what differs from vehicle to vehicle; shares, angles and
# accelerations have none, as gravity is common, nor has the noise of a sensor.
POWERS = {
    "lengths": (1, 0),
    **dict.fromkeys(("push_time", "memory", "duration"), (0, 1)),
    **dict.fromkeys(("damping", "drag", "change"), (0, -1)),
    "swing_noise": (2, -3),
}


def carries(members: int) -> np.ndarray:
    """Return which of a bank's members carry a payload, (k,) of bool: the last of each condition
    does not.
    """
    count = members // len(CONDITIONS)
    return np.tile(np.arange(count) < count - 1, len(CONDITIONS))


@dc.dataclass(frozen=True)
class Prior:
    """Mean and standard deviation of a quantity before any flight."""

    mean: float
    deviation: float

    def __mul__(self, factor: float) -> "Prior":
        """Return the prior of the quantity times `factor`."""
        return Prior(self.mean * factor, self.deviation * factor)


# Mass of a vehicle that carries nothing, over its own [1]; own choice of a deviation by which one
# can divide
NO_MASS = Prior(0.0, 1e-6)


@dc.dataclass(frozen=True)
class BankOptions:
    """What is believed of payload and air before any sample, per mass of the vehicle; in SI for the
    paper's vehicle.

    Source: stated priors. Lengths cover 0.3 to 2.4 m by equal steps of the logarithm, of which half
    is a deviation; a vehicle carries up to half its own weight; a quadrotor's drag is below its
    weight at 20 m/s. Near the ground the wind's vertical deviation is half its level one (Panofsky,
    Dutton 1984: 1.25 and 2.4 friction velocities).
    """

    lengths: tuple[float, ...] = (0.3, 0.5, 0.85, 1.42, 2.4)  # of the members [m]
    log_length: float = 0.26  # deviation of a member's logarithm of length [1]
    # Probability that the vehicle carries nothing: as likely as a tether of each length [1]
    bare: float = 1 / 6
    mass: Prior = Prior(0.1, 0.15)  # of the payload, share of the vehicle's [1]
    damping: Prior = Prior(0.05, 0.1)  # drag of the payload over its mass [1/s]
    thrust_error: Prior = Prior(0.0, 0.1)  # [1]
    drag: Prior = Prior(0.1, 0.2)  # of the vehicle [1/s]
    push: tuple[float, ...] = (0.05, 1.0, 0.05)  # deviation of the slow force by condition [m/s²]
    vertical: float = 0.5  # deviation of the slow force upwards over that on a level axis [1]
    push_time: tuple[float, ...] = (20.0, 10.0, 20.0)  # over which it decays, by condition [s]
    memory: float = 20.0  # over which parameters return to their prior [s]
    tilt: float = 0.1  # deviation of the tether from the vertical at the start [rad]
    lost_tilt: float = 0.5  # deviation after a jump [rad]
    # Power of what pushes the payload, by condition [m²/s³]
    swing_noise: tuple[float, ...] = (1e-4, 0.1, 2.0)
    duration: tuple[float, ...] = (
        20.0,
        5.0,
        0.5,
    )  # of a condition, after which either other begins [s]
    change: float = 0.02  # rate at which the length changes, or a payload comes or goes [1/s]
    # squared innovation that no member exceeds: 1e-5 of the chi-square with three degrees [1]
    jump: float = 24.3
    least_noise: float = 0.02  # of a label [m/s²]

    def scaled(self, unit: Scales) -> "BankOptions":
        """Return what is believed under a vehicle of other units: the same in its lengths and
        times.

        Args: unit: of the vehicle, over those of the paper's.
        """
        factors = {name: unit.length**a * unit.time**b for name, (a, b) in POWERS.items()}
        return dc.replace(
            self, **{name: _times(getattr(self, name), f) for name, f in factors.items()}
        )


def _times(value: Any, factor: float) -> Any:
    """Return a number, a prior or every number of a tuple times `factor`."""
    return tuple(v * factor for v in value) if isinstance(value, tuple) else value * factor


class PendulumBank:
    """Filter of all members; arrays of `memory` are the caller's.

    Args:
        step: between samples [s].
        gravity: [m/s²].
    """

    def __init__(self, options: BankOptions, *, step: float, gravity: float):
        o = self.options = options
        self.step, self.gravity = step, gravity
        # The length of a member without a payload means nothing: the geometric mean of the others
        bare = float(np.exp(np.mean(np.log(o.lengths))))
        lengths = (*o.lengths, bare)
        self.lengths = np.tile(np.array(lengths, float), len(CONDITIONS))
        condition = np.repeat(np.arange(len(CONDITIONS)), len(lengths))
        loaded, count = carries(len(self.lengths)), len(self.lengths)
        self._reach = np.sqrt(gravity / self.lengths)  # rate of a swing over its angle [1/s]
        # Probability of each member before any flight, (k,)
        self._first_weight = np.where(loaded, (1 - o.bare) / loaded.sum(), o.bare / (~loaded).sum())
        # Prior mean and standard deviation of the parameters, (k, 8)
        self._prior, self._deviation = np.zeros((count, 8)), np.empty((count, 8))
        self._prior[:, 0] = np.where(loaded, o.mass.mean, NO_MASS.mean)
        self._prior[:, 1], self._prior[:, 2] = np.log(self.lengths), o.damping.mean
        self._prior[:, 6], self._prior[:, 7] = o.thrust_error.mean, o.drag.mean
        self._deviation[:, 0] = np.where(loaded, o.mass.deviation, NO_MASS.deviation)
        self._deviation[:, [1, 2]] = o.log_length, o.damping.deviation
        push = np.array(o.push)
        self._deviation[:, 3:6] = push[condition][:, None] * [1.0, 1.0, o.vertical]
        self._deviation[:, [6, 7]] = o.thrust_error.deviation, o.drag.deviation
        # Share of the distance to the prior that a parameter keeps in a step, (k, 8)
        self._keep = np.full((count, 8), np.exp(-step / o.memory))
        self._keep[:, 3:6] = np.exp(-step / np.array(o.push_time)[condition])[:, None]
        # Variance that a step adds, (k, SIZE): the parameters keep their prior deviation
        swing = np.array(o.swing_noise)[condition] * step / self.lengths**2
        self._noise = np.zeros((count, kernel.SIZE))
        self._noise[:, 2:4] = swing[:, None]
        self._noise[:, 4:] = (1 - self._keep**2) * self._deviation**2
        self._rise = (push * o.vertical) ** 2  # variance of the slow force upwards, (3,) [m²/s⁴]
        # Probability of a change from one condition to another in a step, (3, 3)
        leave = 1 - np.exp(-step / np.array(o.duration))
        self._transition = np.tile(0.5 * leave[:, None], (1, len(CONDITIONS)))
        np.fill_diagonal(self._transition, 1 - leave)

    def initial_memory(self) -> Memory:
        """Return a tether that hangs still, with all parameters at their prior.

        mean: (k, POINT).   covariance: (k, SIZE, SIZE).   weight: (k,) [1].
        """
        mean = np.zeros((len(self.lengths), kernel.POINT))
        mean[:, 2], mean[:, 3] = -1.0, 1.0
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
        mean, covariance, weight = (
            np.empty_like(memory[name]) for name in ("mean", "covariance", "weight")
        )
        mix_bank(
            memory["mean"],
            memory["covariance"],
            memory["weight"],
            self._transition,
            self._rise,
            mean,
            covariance,
            weight,
        )
        predicted, spread = np.empty_like(mean), np.empty_like(covariance)
        updated, narrowed = np.empty_like(mean), np.empty_like(covariance)
        likelihood, distance = np.empty_like(weight), np.empty_like(weight)
        kernel.filter_bank(
            mean,
            covariance,
            drive,
            now,
            self.step,
            self._prior,
            self._keep,
            self._noise,
            label,
            variance,
            predicted,
            spread,
            updated,
            narrowed,
            likelihood,
            distance,
        )
        if not finite(label):
            return {"mean": predicted, "covariance": spread, "weight": weight}
        if not distance.min() < self.options.jump:
            return self._anew(predicted, spread)
        if not (finite(updated) and finite(narrowed)):
            return self.initial_memory()
        weighed, stay = np.empty_like(weight), float(np.exp(-self.step * self.options.change))
        weigh_bank(
            weight,
            likelihood,
            updated,
            self._prior,
            self._deviation,
            self._first_weight,
            stay,
            weighed,
        )
        return {"mean": updated, "covariance": narrowed, "weight": weighed}

    def _anew(self, mean: np.ndarray, covariance: np.ndarray) -> Memory:
        """Return the memory after a sample that no member explains: payload and swing are
        forgotten, what belongs to the vehicle stays, and the sample itself is not taken in.

        A jerk of the cable tells nothing of the payload's mass. A change that lasts shows in the
        next sample.
        """
        if not (finite(mean) and finite(covariance)):
            return self.initial_memory()
        covariance[:, :7, :], covariance[:, :, :7] = 0.0, 0.0
        deviation = np.empty((len(self.lengths), 7))
        deviation[:, :2] = self.options.lost_tilt
        deviation[:, 2:4] = (self.options.lost_tilt * self._reach)[:, None]
        deviation[:, 4:] = self._deviation[:, :3]
        rows = np.arange(7)
        covariance[:, rows, rows] = deviation**2
        mean[:, kernel.MASS : kernel.DAMPING + 1] = self._prior[:, :3]
        return {"mean": mean, "covariance": covariance, "weight": self._first_weight.copy()}
