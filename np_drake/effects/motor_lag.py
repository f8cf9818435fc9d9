"""Effect `motor_lag`: first-order lag of the rotors."""

import dataclasses as dc

import numpy as np
import scipy

from np_drake.effects.base import ActuatorEffect, Parameter, log_uniform
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class MotorLag(ActuatorEffect):
    """First-order lag of rotor speed, T d omega/dt = omega_command - omega, with f = k omega².

    Source: first-order ESC and motor.
    """

    time_constant: float = 0.03  # [s]

    bench_check = "measure the response of a rotor to a step"
    excited_by = "sharp doublets, and a log of rotor speed"
    requires = ("commands",)
    shifts_commands = True
    linear = False
    parameters = (
        Parameter(
            "time_constant",
            "s",
            0.0,
            0.0,
            0.3,
            0.03,
            departure="rotors lag {size} more|rotors lag {size} less",
        ),
    )
    state_size = 4
    turns_rotor = True

    @classmethod
    def draw(cls, rng: np.random.Generator, vehicle: Vehicle, seconds: float) -> dict[str, float]:
        """Return random parameters of a simulated case, a lag longer than the vehicle file's."""
        nominal = vehicle.rotor_time_constant
        return {"time_constant": float(nominal + log_uniform(rng, 0.008, 0.085 - nominal))}

    @classmethod
    def grid(cls, vehicle: Vehicle) -> list[dict[str, float]]:
        """Return the lags at which a search linearises it."""
        nominal = vehicle.rotor_time_constant
        return [{"time_constant": nominal + float(v)} for v in np.geomspace(0.006, 0.12, 9)]

    def time_shift(self, vehicle: Vehicle) -> float:
        """Return the time by which commands act later than with the lag of the vehicle file [s]."""
        return self.time_constant - vehicle.rotor_time_constant

    def state_at(self, vehicle: Vehicle, thrust: np.ndarray) -> np.ndarray:
        """Return the rotor speed (4,) [rad/s] that holds `thrust` (4,) [N]."""
        return np.sqrt(np.maximum(thrust, 0.0) / vehicle.thrust_coefficient)

    def state_rate(self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the rate of rotor speed, (..., 4) [rad/s²]."""
        return (self.state_at(vehicle, command) - state) / self.time_constant

    def thrust(
        self, vehicle: Vehicle, state: np.ndarray, command: np.ndarray, t: np.ndarray | float = 0.0
    ) -> np.ndarray:
        """Return the thrusts of the rotor speeds, (..., 4) [N]."""
        return vehicle.thrust_coefficient * state**2

    def respond(self, vehicle: Vehicle, t: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the mean thrusts (n, 4) [N]; the lag is exact between rows, the mean is
        Simpson's.
        """
        if self.time_constant <= 0 or len(t) < 2:
            return command
        target = self.state_at(vehicle, command)
        # The lag's solution under a held target, at the middle and the end of each interval.
        decay, half = np.exp(-(t[1] - t[0]) / self.time_constant * np.array([1.0, 0.5]))
        end, _ = scipy.signal.lfilter(
            [1 - decay], [1, -decay], target, axis=0, zi=decay * target[:1]
        )
        start = np.concatenate([target[:1], end[:-1]])
        middle = target + (start - target) * half
        return vehicle.thrust_coefficient * (start**2 + 4 * middle**2 + end**2) / 6


AT_ONCE = 3e-4  # a motor faster than this has no lag; own choice [s]


def at_once(effect: ActuatorEffect) -> bool:
    """Return whether the effect is a lag so short that it would only make an integrator stiff."""
    return isinstance(effect, MotorLag) and effect.time_constant <= AT_ONCE
