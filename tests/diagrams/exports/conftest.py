"""A gentle flight that every simulator flies with the same commands."""

import numpy as np
import pytest

from diagrams.exports.corrected import corrected
from diagrams.gap.rollout import Commands, Rollout, Swing
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

    period, rows = 0.01, 20  # of a command [s]; commands between compared states

    def __init__(self, effects):
        self.vehicle, self.effects = Vehicle(), effects
        c = self.corrected = corrected(self.vehicle, effects)
        t = np.arange(0.0, 5.0 - 1e-9, self.period)
        thrust = 4 * c.hover_thrust / c.scale * (1.0 + 0.04 * np.sin(2.1 * t))
        roll, pitch = 0.008 * np.cos(2.5 * t), 0.01 * np.cos(3.0 * t)
        if c.payload is not None:  # a hook in front pulls the nose down
            pitch = pitch - c.payload.hook_x * c.payload.mass * self.vehicle.gravity
        self.u = np.stack([thrust, roll, pitch, 0.004 * np.cos(1.3 * t)], axis=1)
        self.thrusts = self.u @ self.vehicle.unmixer.T

    def drake(self):
        """States (26, 13) of the flight in Drake."""
        start = np.array([0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0])
        hung = self.corrected.payload
        swing = Swing(np.array([0, 0, -hung.length]), np.zeros(3), np.zeros(3)) if hung else None
        commands = Commands(self.period * np.arange(len(self.u)), self.u)
        times = np.arange(0.0, 5.0 + 1e-9, self.rows * self.period)
        flown = Rollout(self.vehicle, self.effects).fly(start, commands, times, swing)[:, :13]
        return np.concatenate([start[None], flown])


def furthest(a, b):
    """Largest differences of position [m] and attitude [rad] of two flights (n, 13)."""
    assert np.linalg.norm(b[-1, :3]) > 5.0  # it flew [m]
    position = np.linalg.norm(a[:, :3] - b[:, :3], axis=1).max()
    return position, 2 * np.linalg.norm(a[:, 3:7] - b[:, 3:7], axis=1).max()


EFFECTS = {
    "exact": [ThrustScale(0.93), MassError(0.15), InertiaError(1.2, 0.9, 1.1)],
    "lag": [MotorLag(0.04)],
    "drag": [LinearDrag(0.3, 0.3, 0.25)],
    "payload": [SuspendedPayload(mass=0.26, length=0.8, hook_x=0.02, hook_z=-0.05, damping=0.05)],
}


@pytest.fixture(scope="session", params=list(EFFECTS))
def gentle(request):
    """Name of a vehicle, its flight, that flight in Drake, and the measure."""
    flight = GentleFlight(EFFECTS[request.param])
    return request.param, flight, flight.drake(), furthest
