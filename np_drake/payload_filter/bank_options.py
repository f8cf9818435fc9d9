"""What is believed of payload and air before a flight, by a bank of pendulums."""

import dataclasses as dc
import math
from typing import Any

from np_drake.checks import require
from np_drake.vehicle.scaling import Scales

# Powers of length and time in the unit of what differs from vehicle to vehicle; shares, angles and
# accelerations have none, as gravity is common, nor has the noise of a sensor.
POWERS = {
    "lengths": (1, 0),
    **dict.fromkeys(("push_time", "memory", "duration"), (0, 1)),
    **dict.fromkeys(("damping", "drag", "change"), (0, -1)),
    "swing_noise": (2, -3),
}

# options with a value a condition
CONDITIONAL = "push", "push_time", "memory", "swing_noise", "duration"
# options with a mean and a deviation
PRIORS = ("mass", "damping", "thrust_error", "drag")


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

    Source of the defaults, from which learning starts: own choice, for calm air, steady wind, gusts
    and a payload that changes. Lengths cover 0.3 to 2.4 m by equal steps of the logarithm; a
    vehicle carries up to half its own weight; a quadrotor's drag is below its weight at 20 m/s.
    Near the ground the wind's vertical deviation is half its level one (Panofsky, Dutton 1984: 1.25
    and 2.4 friction velocities).
    """

    lengths: tuple[float, ...] = (0.3, 0.5, 0.85, 1.42, 2.4)  # of the members [m]
    log_length: float = 0.09  # deviation of a member's logarithm of length [1]
    # Probability that the vehicle carries nothing: as likely as a tether of each length [1]
    bare: float = 1 / 6
    mass: Prior = Prior(0.1, 0.15)  # of the payload, share of the vehicle's [1]
    damping: Prior = Prior(0.05, 0.3)  # drag of the payload over its mass [1/s]
    thrust_error: Prior = Prior(0.0, 0.1)  # [1]
    drag: Prior = Prior(0.1, 0.2)  # of the vehicle [1/s]
    # deviation of the slow force by condition [m/s²]
    push: tuple[float, ...] = (0.006, 0.2, 0.2, 0.017)
    vertical: float = 0.5  # deviation of the slow force upwards over that on a level axis [1]
    # over which it decays, by condition [s]
    push_time: tuple[float, ...] = (2.5, 600.0, 4.0, 20.0)
    # over which parameters return to their prior [s]
    memory: tuple[float, ...] = (180.0, 180.0, 180.0, 0.2)
    tilt: float = 0.1  # deviation of the tether from the vertical at the start [rad]
    lost_tilt: float = 0.5  # deviation after a jump [rad]
    # Power of what pushes the payload, by condition [m²/s³]
    swing_noise: tuple[float, ...] = (1e-4, 1e-4, 0.01, 10.0)
    # of a condition, after which any other begins [s]
    duration: tuple[float, ...] = (60.0, 60.0, 15.0, 1.5)
    change: float = 0.02  # rate at which the length changes, or a payload comes or goes [1/s]
    # squared innovation that no member exceeds: 1e-5 of the chi-square with three degrees [1]
    jump: float = 24.3
    least_noise: float = 0.02  # of a label [m/s²]

    def __post_init__(self):
        kinds = [len(getattr(self, name)) for name in CONDITIONAL]
        require(
            len(set(kinds)) == 1 and kinds[0] >= 2 and len(self.lengths) >= 1,
            f"BankOptions: {', '.join(CONDITIONAL)} must be of the same conditions, two at least.",
        )
        times = [*self.push_time, *self.memory, *self.duration]
        singles = [self.log_length, self.vertical, self.jump, self.least_noise]
        deviations = [getattr(self, name).deviation for name in PRIORS]
        positive = [*self.lengths, *times, *singles, self.tilt, self.lost_tilt, *deviations]
        numbers = [*self.push, *self.swing_noise, self.change, *positive]
        require(
            all(math.isfinite(number) and number >= 0 for number in numbers)
            and min(positive) > 0
            and 0 < self.bare < 1
            and all(math.isfinite(getattr(self, name).mean) for name in PRIORS),
            "BankOptions: lengths, times and deviations must be positive, noise and change not "
            "negative, bare between 0 and 1, all finite.",
        )

    @property
    def conditions(self) -> int:
        """Number of conditions of each length."""
        return len(self.push)

    def as_numbers(self) -> dict[str, Any]:
        """Return the fields as JSON holds them; a prior is [mean, deviation]."""
        values = {f.name: getattr(self, f.name) for f in dc.fields(self)}
        return {k: list(dc.astuple(v)) if isinstance(v, Prior) else v for k, v in values.items()}

    @classmethod
    def of_numbers(cls, numbers: dict[str, Any]) -> "BankOptions":
        """Return the options in `as_numbers`.

        Raises: TypeError, ValueError: where they are none.
        """
        made: dict[str, Any] = {}
        for f in dc.fields(cls):
            value = numbers[f.name]
            if isinstance(f.default, Prior):
                made[f.name] = Prior(*map(float, value))
            elif isinstance(f.default, tuple):
                made[f.name] = tuple(map(float, value))
            else:
                made[f.name] = float(value)
        return cls(**made)

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
