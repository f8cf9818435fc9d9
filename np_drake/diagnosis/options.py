"""What a diagnosis takes as given: tolerances, bounds of what matters, priors and thresholds, as
documented fields.
"""

import dataclasses as dc
import math

from np_drake.effects.base import Effect
from np_drake.vehicle import Vehicle
from np_drake.vehicle.sources import HALF_WIDTH_95 as HALF_WIDTH_95


@dc.dataclass(frozen=True)
class Tolerance:
    """Standard deviations. Source: own choice: a kitchen scale, motion capture, a MEMS sensor, a
    Kalman filter.
    """

    mass: float = 0.005  # [1]
    thrust: float = 0.005  # [1]
    acceleration: float = 0.055  # from flight to flight [m/s²]
    attitude: float = 0.008  # from flight to flight [rad]
    rate: float = 0.01  # from flight to flight [rad/s]
    velocity: float = 0.02  # from flight to flight [m/s]
    # What the input of the logs leaves open; 0 where it is a command in newtons that is held from
    # its row.
    timing: float = 0.0  # time at which a row's command acts [s]
    throttle_curve: float = 0.0  # exponent of thrust over throttle [1]
    mounting: float = 0.0  # axes of an autopilot against those of the rotors [rad]
    latency: float = 0.0  # of an estimator's attitude against its velocity [s]
    # Whether the vehicle that flew was never measured: it is as healthy vehicles differ from their
    # files.
    unmeasured: bool = False
    real: bool = True  # whether the sensors are real ones, and not those of a simulator
    # Whether a battery may have been taken out since flights before: trim and thrust then differ.
    reseated: bool = True

    def of(self, effect: Effect | type[Effect]) -> float:
        """Return the tolerance of the sensor that an effect is about; 0 for others."""
        sensor = effect.tolerance and effect.place == "measurement"
        return float(getattr(self, effect.tolerance)) if sensor else 0.0


IDEAL_SENSORS = Tolerance(0.0005, 0.0005, 0.003, 0.0004, 0.0001, 0.0001, real=False, reseated=False)


@dc.dataclass(frozen=True)
class Materiality:
    """Bounds of the region of practical equivalence with no effect; the defaults are those of real
    sensors.

    Source: own choice, where a field names none.
    """

    force: float = 0.006  # RMS force over weight, in all flights [1]; ideal sensors: 0.003
    torque: float = 0.01  # RMS torque over RMS commanded torque [1]; ideal sensors: 0.003
    # Of weight: mass and thrust below it are what vehicle files are off by [1].
    calibration_force: float = 0.02
    still_air: float = 0.25  # mean level wind [m/s]; source: draught in rooms, ISO 7730
    sensor: float = 1.5  # size of a sensor error over the tolerance of that sensor [1]
    structure_share: float = 0.03  # of a channel's power, for a spectral line [1]
    # Of what the causes leave: position error of a simulator after 1 s [m]; ideal sensors: 0.02.
    # RMS force over weight [1]; ideal sensors: 0.008.
    position: float = 0.05
    remaining_force: float = 0.02


@dc.dataclass(frozen=True)
class Size:
    """Size of a term.

    Args:
        force: over weight [1].
        torque: over RMS commanded torque [1].
        gap: share of the gap above the noise [1]. sensor: of a sensor error, its size over the
            tolerance [1].
    """

    force: float
    torque: float
    gap: float
    sensor: float


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
    # Less in log prior, for a change that many parts of a vehicle would have to make at once.
    concerted: float = 3.0
    concerted_changes: tuple[str, ...] = ()  # such effects, where flights before are given
    # deviation of its force over weight, of its torque over weight times arm [1]
    generic_size: float = 0.04
    twist_torque: float = 0.3  # deviation of a twist's torque over the commanded one [1]
    # Onsets.
    # log prior of an onset in a flight, and of absence beside an onset
    onset: float = math.log(1 / 4)
    onset_gain: float = 8.0  # log likelihood that a known onset must bring on a held-out flight
    new_onset_gain: float = 30.0  # the same where no training flight has an onset
    # Payloads.
    payload_mass: float = 0.1  # deviation of the mass over the vehicle's [1]
    hook: float = 0.1  # deviation of each coordinate of the hook [m]
    length: float = 0.05  # deviation of the length about a guess, relative [1]
    damping: float = 0.15  # deviation of the damping [1/s]; source: `SuspendedPayload`
    swing: float = 0.15  # deviation of an initial swing [rad]
    # Relative model error of a pendulum's mass [1]; ideal sensors: 0.006. Source: simulated
    # flights.
    pendulum: float = 0.02
    # Slow forces: what sensors do alone, and gusts.
    # correlation time [s] and its deviation [e-folds]
    attitude_drift: tuple[float, float] = 10.0, 0.45
    # deviation of an attitude error's size about the tolerance [e-folds]
    attitude_spread: float = 0.25
    # tolerances a root e-fold, deviation [e-folds]
    accelerometer_flicker: tuple[float, float] = 0.55, 0.4
    # correlation time of gusts [s] and its deviation [e-folds]
    gust_time: tuple[float, float] = 1.0, 0.6

    def of_effect(self, identifier: str) -> float:
        """Return the log prior of one effect or generic structure (`unknown:…`)."""
        generic = self.generic * identifier.startswith("unknown")
        return self.effect - generic - self.concerted * (identifier in self.concerted_changes)


@dc.dataclass(frozen=True)
class Thresholds:
    """Thresholds of the decision; the defaults are those of real sensors.

    Source: own choice, where a field names none. Probabilities and ratios are pure numbers.
    """

    # A cause.
    cause_probability: float = 0.5  # least probability; ideal sensors: 0.75
    # difference of log evidence below which two effects are indistinguishable
    indistinguishable_evidence: float = 3.5
    # Second answer.
    # held-out residual over noise, for a second answer; ideal sensors: 1.25
    misfit_ratio: float = 1.6
    # Tests of what is left.
    burst_ratio: float = 8.0  # of a slow force over its usual deviation
    line_ratio: float = 20.0  # power of a spectral line over its neighbourhood
    slow_torque_ratio: float = 12.0  # over that of gyro noise; ideal sensors: 9
    # Share of a threshold that held-out flights must show, and of slow power that a swing which was
    # lost leaves.
    held_out_share: float = 0.5
    # Gusts.
    slow_force_evidence: float = 5.0  # log evidence of a slow force at even odds
    # probability below which a slow force does not follow the place by chance
    position_p_value: float = 1e-3


@dc.dataclass(frozen=True)
class Options:
    """What a diagnosis is made with; change fields by `dataclasses.replace`."""

    tolerance: Tolerance  # what vehicle file and sensors may be off by
    materiality: Materiality  # sizes below which effects are immaterial
    priors: Priors  # of models and parameters
    thresholds: Thresholds  # of the decision

    def with_material(self, position: float) -> "Options":
        """Return the options by which a remainder is material from this position error on, and a
        force in proportion.

        Args:
            position: of a simulator after 1 s [m].
        Raises: ValueError: if it is not positive.
        """
        if not 0 < position < math.inf:
            raise ValueError(
                f"diagnose: a material position error must be positive and finite [m]; got "
                f"{position}."
            )
        force = self.materiality.remaining_force * position / self.materiality.position
        return dc.replace(
            self, materiality=dc.replace(self.materiality, position=position, remaining_force=force)
        )

    def within_timing(self, effect: Effect, vehicle: Vehicle) -> bool:
        """Return whether an effect shifts commands by no more than the logs leave open."""
        shift = abs(effect.time_shift(vehicle))
        return 0 < shift < self.materiality.sensor * self.tolerance.timing

    @classmethod
    def for_sensors(cls, real: bool, tolerance: Tolerance | None = None) -> "Options":
        """Return the options for real or ideal sensors.

        Args:
            tolerance: of vehicle file and sensors; default: `Tolerance()` where real, else
                `IDEAL_SENSORS`.
        """
        if real:
            return cls(tolerance or Tolerance(), Materiality(), Priors(), Thresholds())
        return cls(
            tolerance or IDEAL_SENSORS,
            Materiality(force=0.003, torque=0.003, position=0.02, remaining_force=0.008),
            Priors(pendulum=0.006),
            Thresholds(cause_probability=0.75, misfit_ratio=1.25, slow_torque_ratio=9.0),
        )
