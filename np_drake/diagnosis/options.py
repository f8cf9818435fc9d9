"""Constants that steer the answer of a diagnosis, as documented fields, resolved for real or ideal sensors."""

import dataclasses as dc
import math

from np_drake.diagnosis.materiality import Materiality
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance


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
    generic: float = 3.0  # less in log prior, for structure that is no effect
    generic_size: float = 0.04  # deviation of its force over weight, of its torque over weight times arm [1]
    twist: float = 0.3  # deviation of a twist's torque over the commanded one [1]
    # Onsets.
    onset: float = math.log(1 / 4)  # log prior of an onset in a flight, and of absence beside an onset
    onset_gain: float = 8.0  # log likelihood that a known onset must bring on a held-out flight
    new_onset_gain: float = 30.0  # the same where no training flight has an onset
    # Payloads.
    payload_mass: float = 0.1  # deviation of the mass over the vehicle's [1]
    hook: float = 0.1  # deviation of each coordinate of the hook [m]
    length: float = 0.05  # deviation of the length about a guess, relative [1]
    damping: float = 0.15  # deviation of the damping [1/s]; source: `SuspendedPayload`
    swing: float = 0.15  # deviation of an initial swing [rad]
    # Relative model error of a pendulum's mass [1]; ideal sensors: 0.006. Source: simulated flights.
    pendulum: float = 0.02
    # Slow forces: what sensors do alone, and gusts.
    attitude_wander: tuple[float, float] = (10.0, 0.45)  # correlation time [s] and its deviation [e-folds]
    attitude_spread: float = 0.25  # deviation of an attitude error's size about the tolerance [e-folds]
    accelerometer_flicker: tuple[float, float] = (0.55, 0.4)  # tolerances a root e-fold, deviation [e-folds]
    gust_time: tuple[float, float] = (1.0, 0.6)  # correlation time of gusts [s] and its deviation [e-folds]

    def of_effect(self, identifier: str) -> float:
        """Return the log prior of one effect or generic structure (`unknown:…`)."""
        return self.effect - (self.generic if identifier.startswith("unknown") else 0.0)


@dc.dataclass(frozen=True)
class Thresholds:
    """Thresholds of the decision; the defaults are those of real sensors.

    Source: own choice, where a field names none. Probabilities and ratios are pure numbers.
    """

    # A cause.
    sure: float = 0.5  # least probability; ideal sensors: 0.75
    same: float = 3.5  # difference of log evidence below which two effects are indistinguishable
    # Second answer.
    misfit: float = 1.6  # held-out residual over noise, for a second answer; ideal sensors: 1.25
    # Tests of what is left.
    burst: float = 8.0  # of a slow force over its usual deviation
    line: float = 20.0  # power of a spectral line over its neighbourhood
    slow_torque: float = 12.0  # over that of gyro noise; ideal sensors: 9
    # Share of a threshold that held-out flights must show, and of slow power that a swing which was lost leaves.
    held_out_share: float = 0.5
    # Gusts.
    slow_force: float = 5.0  # log evidence of a slow force at even odds
    place: float = 1e-3  # probability below which a slow force does not follow the place by chance


@dc.dataclass(frozen=True)
class Options:
    """What a diagnosis is made with; change fields by `dataclasses.replace`."""

    tolerance: Tolerance  # what vehicle file and sensors may be off by
    materiality: Materiality  # sizes below which effects are immaterial
    priors: Priors  # of models and parameters
    thresholds: Thresholds  # of the decision

    @classmethod
    def for_sensors(cls, real: bool, tolerance: Tolerance | None = None) -> "Options":
        """Return the options for real or ideal sensors.

        Args:
            real: whether logs come from real sensors.
            tolerance: of vehicle file and sensors; default: `Tolerance()` where real, else `IDEAL_SENSORS`.
        """
        if real:
            return cls(tolerance or Tolerance(), Materiality(), Priors(), Thresholds())
        return cls(
            tolerance or IDEAL_SENSORS,
            Materiality(force=0.003, torque=0.003),
            Priors(pendulum=0.006),
            Thresholds(sure=0.75, misfit=1.25, slow_torque=9.0),
        )
