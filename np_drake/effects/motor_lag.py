"""Effect `motor_lag`: first-order lag of the rotors."""

import dataclasses as dc

import numpy as np

from np_drake.compiled import compiled
from np_drake.effects.base import ActuatorEffect, Parameter, log_uniform
from np_drake.vehicle import Vehicle


@compiled
def lagged(target: np.ndarray, row: np.ndarray, step: float, up: float, down: float) -> np.ndarray:
    """Return rotor speeds (m + 1, 4) at the edges of substeps, exact for a held target.

    Args:
        target: (n, 4) speeds that the rows command; rotors begin at the first.
        row: (m,) row whose target is held in each substep.
        step: length of a substep [s].
        up: time constant of a rising speed [s].
        down: time constant of a falling speed [s].
    """
    rise = np.exp(-step / up) if up > 0.0 else 0.0
    fall = np.exp(-step / down) if down > 0.0 else 0.0
    out = np.empty((row.size + 1, target.shape[1]))
    out[0] = target[row[0]]
    for k in range(row.size):
        for i in range(target.shape[1]):
            wanted = target[row[k], i]
            share = rise if wanted > out[k, i] else fall
            out[k + 1, i] = wanted + (out[k, i] - wanted) * share
    return out


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

    @property
    def slowing(self) -> float:
        """Time constant of a rotor that slows down [s]."""
        return self.time_constant

    def follow(self, target: np.ndarray, row: np.ndarray, step: float) -> np.ndarray:
        """Return the rotor speeds (m + 1, 4) at the edges of substeps, from rest.

        Args:
            target: (n, 4) speeds that the rows command.
            row: (m,) row whose target is held in each substep.
            step: length of a substep [s].
        """
        return lagged(np.ascontiguousarray(target), row, step, self.time_constant, self.slowing)

    def respond(self, vehicle: Vehicle, t: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Return the mean thrusts (n, 4) [N]; the lag is exact between rows, the mean is
        Simpson's.
        """
        if self.time_constant <= 0 or len(t) < 2:
            return command
        target = self.state_at(vehicle, command)
        speed = self.follow(target, np.repeat(np.arange(len(t)), 2), 0.5 * (t[1] - t[0]))
        start = speed[:-1:2]
        middle = speed[1::2]
        end = speed[2::2]
        return vehicle.thrust_coefficient * (start**2 + 4 * middle**2 + end**2) / 6


AT_ONCE = 3e-4  # a motor faster than this has no lag; own choice [s]


def at_once(effect: ActuatorEffect) -> bool:
    """Return whether the effect is a lag so short that it would only make an integrator stiff."""
    return isinstance(effect, MotorLag) and effect.time_constant <= AT_ONCE
