"""Initial state of a payload under a logged flight, from which a replay starts."""

from typing import NamedTuple

import numpy as np

from np_drake import attitude
from np_drake.diagnosis.gap.initial_states import States, local_polynomial
from np_drake.effects.base import Motion
from np_drake.effects.combine import EffectsByPlace, mass_properties, total_wrench
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.rigid_body import Q, V
from np_drake.vehicle import Vehicle

SPAN = 0.1  # half width of the local parabolas through velocity, force and direction [s]
SLACK = 0.2  # pull over the payload's weight below which its direction is unknown [1]


class Track(NamedTuple):
    """Payload relative to its hook in W: t (n,) [s], r (n, 3) [m], r_rate (n, 3) [m/s]."""

    t: np.ndarray
    r: np.ndarray
    r_rate: np.ndarray

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return r (3,) [m] and r_rate (3,) [m/s] at `time` [s], by linear interpolation."""
        r, rate = (np.array([np.interp(time, self.t, column) for column in value.T]) for value in self[1:])
        return r, rate


def payload_track(
    log: FlightLog, states: States, vehicle: Vehicle, effects: EffectsByPlace, payload: SuspendedPayload
) -> Track:
    """Return the payload's track along the force that the flight shows beyond thrust, weight and the other effects.

    m (a + g z) = R z f + f_effects + T r / L, smoothed over ± `SPAN`. Where the tether hardly pulls, r lies along the
    apparent gravity.

    Args:
        log: the flight, for its commands.
        states: states of the quadrotor.
        vehicle: the nominal vehicle.
        effects: all effects except the payload.
        payload: the payload.
    Source: Newton's second law for the quadrotor.
    """
    step = float(np.median(np.diff(states.t)))
    gravity = np.array([0.0, 0.0, vehicle.gravity])
    specific = local_polynomial(states.x[:, V], step, SPAN, order=2, derivative=1) + gravity
    pushed = local_polynomial(_other_forces(log, states, vehicle, effects), step, SPAN, order=2)
    pull = mass_properties(vehicle, effects.mass).mass * specific - pushed
    strong = np.linalg.norm(pull, axis=1, keepdims=True) > SLACK * payload.mass * vehicle.gravity
    down = np.where(strong, pull, -specific)
    r = payload.length * down / np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)
    return Track(states.t, r, local_polynomial(r, step, SPAN, order=2, derivative=1))


def _other_forces(log: FlightLog, states: States, vehicle: Vehicle, effects: EffectsByPlace) -> np.ndarray:
    """Return thrust plus the forces of the other effects (n, 3) in W [N]."""
    u = np.stack([np.interp(states.t, log.t, column) for column in log.u.T], axis=1)
    thrust = vehicle.saturate(u) @ vehicle.unmixer.T
    for effect in effects.actuator:
        thrust = effect.respond(vehicle, states.t, thrust)
    force = total_wrench(vehicle, effects.wrench, Motion(states.t, states.x, thrust))[:, :3]
    return force + attitude.body_z(states.x[:, Q]) * thrust.sum(axis=1, keepdims=True)
