"""A gentle flight that every simulator flies with the same commands."""

from collections.abc import Sequence

import numpy as np
import pytest

from diagrams.exports.corrected import Corrected, corrected
from diagrams.gap.rollout import Commands, Rollout, Swing
from np_drake.effects.base import Effect
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle


class GentleFlight:
    """5 s open loop near hover, with commands held for 10 ms; it sways by 0.1 to 0.2 rad and flies
    some 10 m.

    The rotors start at rest on a command that carries the weight. Drake's steps of 10 ms, of third
    order, leave 1e-6 m.
    """

    period, rows, duration = (
        0.01,
        20,
        5.0,
    )  # of a command [s]; commands between compared states; [s]

    def __init__(self, effects: Sequence[Effect], vehicle: Vehicle | None = None):
        self.vehicle, self.effects = vehicle or Vehicle(), list(effects)
        self.corrected: Corrected = corrected(self.vehicle, self.effects)
        self.times = np.arange(0.0, self.duration + 1e-9, self.rows * self.period)
        self.start = np.array([0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0])
        self.u = self._u()

    def _u(self) -> np.ndarray:
        c, t = self.corrected, np.arange(0.0, self.duration - 1e-9, self.period)
        thrust = 4 * c.hover_thrust / c.scale * (1.0 + 0.04 * np.sin(2.1 * t))
        roll, pitch = 0.008 * np.cos(2.5 * t), 0.01 * np.cos(3.0 * t)
        if c.payload is not None:  # a hook in front pulls the nose down
            pitch = pitch - c.payload.hook_x * c.payload.mass * self.vehicle.gravity
        return np.stack([thrust, roll, pitch, 0.004 * np.cos(1.3 * t)], axis=1)

    @property
    def thrusts(self) -> np.ndarray:
        """Commanded rotor thrusts (500, 4) [N]."""
        return self.u @ self.vehicle.unmixer.T

    @property
    def speeds(self) -> np.ndarray:
        """Commanded rotor speeds (500, 4) [rad/s]."""
        return np.sqrt(self.thrusts / self.vehicle.thrust_coefficient)

    @property
    def first_speed(self) -> np.ndarray:
        """Rotor speeds (4,) in the beginning [rad/s]."""
        return np.full(4, np.sqrt(self.corrected.hover_thrust / self.vehicle.thrust_coefficient))

    def drake(self) -> np.ndarray:
        """States (26, 13) of the flight in Drake."""
        hung = self.corrected.payload
        swing = Swing(np.array([0, 0, -hung.length]), np.zeros(3), np.zeros(3)) if hung else None
        commands = Commands(self.period * np.arange(len(self.u)), self.u)
        flown = Rollout(self.vehicle, self.effects).fly(self.start, commands, self.times, swing)[
            :, :13
        ]
        return np.concatenate([self.start[None], flown])


def furthest(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest differences of position [m] and attitude [rad] of two flights (n, 13)."""
    position = np.linalg.norm(a[:, :3] - b[:, :3], axis=1).max()
    attitude = 2 * np.linalg.norm(a[:, 3:7] - b[:, 3:7], axis=1).max()
    return float(position), float(attitude)


class Gentle:
    """What the tests take: the flight, its measure, and three vehicles."""

    Flight = GentleFlight
    furthest = staticmethod(furthest)
    effects: dict[str, list[Effect]] = {
        "nominal": [],
        "exact": [ThrustScale(0.93), MassError(0.15), InertiaError(1.2, 0.9, 1.1)],
        "lag": [MotorLag(0.04)],
        "drag": [LinearDrag(0.3, 0.3, 0.25)],
        "all": [
            *(ThrustScale(0.93), MotorLag(0.04), LinearDrag(0.3, 0.3, 0.25)),
            *(MassError(0.15), InertiaError(1.2, 0.9, 1.1)),
        ],
        "payload": [
            SuspendedPayload(mass=0.26, length=0.8, hook_x=0.02, hook_z=-0.05, damping=0.05)
        ],
    }


@pytest.fixture(scope="session")
def gentle() -> type[Gentle]:
    """The flight and its vehicles."""
    return Gentle
