"""What vehicle file and sensors may be off by without a cause."""

import dataclasses as dc

import numpy as np

from np_drake.effects.base import Effect
from np_drake.vehicle import Vehicle

REAL = 0.002  # tolerance of the attitude above which sensors are real ones [rad]


@dc.dataclass(frozen=True)
class Tolerance:
    """Standard deviations. Source: own choice: a kitchen scale, motion capture, a MEMS sensor, a Kalman filter."""

    mass: float = 0.005  # [1]
    thrust: float = 0.005  # [1]
    acceleration: float = 0.055  # from flight to flight [m/s²]
    attitude: float = 0.008  # from flight to flight [rad]
    rate: float = 0.01  # from flight to flight [rad/s]
    velocity: float = 0.02  # from flight to flight [m/s]
    # What the input of the logs leaves open; 0 where it is a command in newtons that is held from its row.
    timing: float = 0.0  # time at which a row's command acts [s]
    throttle_curve: float = 0.0  # exponent of thrust over throttle [1]
    mounting: float = 0.0  # axes of an autopilot against those of the rotors [rad]
    latency: float = 0.0  # of an estimator's attitude against its velocity [s]
    throttle_drift: float = 0.0  # rate of thrust over throttle as the battery falls [1/s]

    @property
    def name(self) -> str:
        """Return `rig` for real sensors, `laboratory` for ideal ones."""
        return "rig" if self.real else "laboratory"

    @property
    def lean(self) -> float:
        """Attitude error against the rotors' axes, all together [rad]."""
        return float(np.hypot(self.attitude, self.mounting))

    @property
    def real(self) -> bool:
        """Whether the sensors are real ones."""
        return self.attitude > REAL

    def of(self, effect: Effect | type[Effect]) -> float:
        """Return the tolerance of the sensor that an effect is about; 0 for others."""
        sensor = effect.tolerance and effect.place == "measurement"
        return float(getattr(self, effect.tolerance)) if sensor else 0.0

    def with_vehicle(self, vehicle: Vehicle) -> "Tolerance":
        """Return the tolerance whose mass and thrust are at least what the vehicle file states for its own."""
        return dc.replace(
            self,
            mass=max(self.mass, vehicle.mass_uncertainty or 0.0),
            thrust=max(self.thrust, vehicle.thrust_uncertainty or 0.0),
        )


IDEAL_SENSORS = Tolerance(0.0005, 0.0005, 0.003, 0.0004, 0.0001, 0.0001)
