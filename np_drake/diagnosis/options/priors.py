"""Prior probabilities of effects and onsets, and prior deviations of parameters."""

import dataclasses as dc
import math


@dc.dataclass(frozen=True)
class Priors:
    """Priors of models and parameters; the defaults are those of real sensors.

    Source: own choice, where a field names none.
    """

    # Noise.
    temperature: float = 2.0  # factor on its variance, as it is never quite its model [1]
    linear_error: float = 0.03  # share that linear columns get wrong of what they explain [1]
    # Effects and structure.
    effect: float = -3.0  # log prior of every effect named: about one in twenty
    clock_offset: float = (
        0.7  # less in log prior: half as likely as a delay, the same but for where it arises
    )
    generic: float = 3.0  # less in log prior, for structure that is no effect
    generic_size: float = (
        0.04  # deviation of its force over weight, and of its torque over weight times arm [1]
    )
    twist: float = 0.3  # deviation of a twist's torque over the commanded one [1]
    # Onsets.
    first_onset: float = math.log(1 / 6)  # log prior of an onset in a flight
    another_onset: float = math.log(1 / 2)  # log prior of an onset in one more flight
    absence: float = math.log(1 / 4)  # log prior of an effect that has not begun at the end of a flight
    onset_gain: float = 8.0  # log likelihood that a known onset must bring on a held-out flight
    new_onset_gain: float = 30.0  # the same where no training flight has an onset
    # Payloads.
    payload_mass: float = 0.1  # deviation of the mass over the vehicle's [1]
    hook: float = 0.1  # deviation of each coordinate of the hook [m]
    length: float = 0.05  # deviation of the length about a guess, relative [1]
    damping: float = 0.15  # deviation of the damping [1/s]; source: `SuspendedPayload`
    swing: float = 0.15  # deviation of an initial swing [rad]
    # Model error of a pendulum; source: simulated flights. Ideal sensors: 0.006, 0.003, 0.0003.
    pendulum_mass: float = 0.02  # relative [1]
    pendulum_length: float = 0.008  # relative [1]
    pendulum_hook: float = 0.001  # [m]
    pendulum_damping: float = 0.01  # [1/s]; own choice, as is 0.003 for ideal sensors
    # Slow forces: what sensors do alone, and gusts.
    attitude_wander: tuple[float, float] = (10.0, 0.45)  # correlation time [s] and its deviation [e-folds]
    attitude_spread: float = (
        0.25  # deviation of an attitude error's size, of which the tolerance is the median [e-folds]
    )
    accelerometer_flicker: tuple[float, float] = (
        0.55,
        0.4,
    )  # tolerances per root e-fold, its deviation [e-folds]
    white_spread: float = 3.0  # deviation of the white noise of either [e-folds]
    gust_time: tuple[float, float] = (1.0, 0.6)  # correlation time of gusts [s] and its deviation [e-folds]
    calm_wander_time: float = 8.0  # correlation time of an attitude error before a wind begins [s]
    calm_wander_spread: float = 0.7  # deviation of its size [e-folds]
    flight_mean: float = 1.0  # deviation of a flight's own mean wind over that of the gusts [1]
    wind_onset_gain: float = 8.0  # log likelihood that a better begin of a wind must bring
    joint_onset_move: float = (
        2.0  # the same for another instant, where the drag's begin is weighed with the wind's
    )
    drag_axes: tuple[float, float, float] = (
        0.3,
        0.3,
        1.0,
    )  # deviation of each axis from their common drag, over it [1]
    drag_spread: float = 1.0  # deviation of that drag about a usual one [e-folds]
    upward_wind: float = 0.5  # deviation of a mean wind upward: the ground is near [m/s]
    wind_over_unknown: float = (
        4.6  # log odds of wind against what the library lacks, for a slow force of no shape
    )

    def of_effect(self, identifier: str) -> float:
        """Return the log prior of one effect or generic structure (`unknown:…`)."""
        less = {"clock_offset": self.clock_offset, "unknown": self.generic}
        return self.effect - less.get(identifier.split(":")[0], 0.0)
