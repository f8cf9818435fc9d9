"""Open-loop prediction: the identified model from logged states on, driven by what turned the
rotors.
"""

import dataclasses as dc

import numpy as np

from np_drake import attitude
from np_drake.flight_log import FlightLog
from np_drake.identification.frame import G, Values, inertia
from np_drake.identification.model import FlightModel

# of a bin; own choice: half of 10 ms, at which the fourth-order rule is exact for a rigid body
SUBSTEPS = 2
ERRORS = ("position", "velocity", "attitude", "rates")  # [m, m/s, rad, rad/s]


@dc.dataclass(frozen=True)
class Prediction:
    """Predictions from several starts of one flight.

    t: (k + 1,) time from the start [s].
    first: (s,) rows of the log at which they start.
    x: (k + 1, s, 13) states. rows: (k + 1, s) rows of the log at these times.
    """

    t: np.ndarray
    first: np.ndarray
    x: np.ndarray
    rows: np.ndarray

    def errors(self, log: FlightLog) -> np.ndarray:
        """Return the errors (k + 1, s, 4), of `ERRORS`."""
        true = log.x[self.rows]
        between = attitude.multiply(attitude.conjugate(true[..., 3:7]), self.x[..., 3:7])
        return np.stack(
            [
                np.linalg.norm(self.x[..., 0:3] - true[..., 0:3], axis=-1),
                np.linalg.norm(self.x[..., 7:10] - true[..., 7:10], axis=-1),
                np.linalg.norm(attitude.rotation_vector(between), axis=-1),
                np.linalg.norm(self.x[..., 10:13] - true[..., 10:13], axis=-1),
            ],
            axis=-1,
        )


def predict(
    model: FlightModel, log: FlightLog, v: Values, *, seconds: float, every: float = 0.1
) -> Prediction:
    """Return open-loop predictions.

    Args:
        seconds: length of a prediction [s].
        every: between starts [s].
    """
    s = model.flight
    steps, apart = max(1, round(seconds / s.step)), max(1, round(every / s.step))
    first = np.arange(0, len(s) - steps, apart)
    first = np.array([b for b in first if s.good[b : b + steps].all()], int)
    if not len(first):
        raise ValueError(f"{log.name}: no stretch of {seconds:g} s without gaps to predict.")
    center = model.center(v)
    x = log.x[s.edges[first]]
    R = attitude.rotation_matrix(x[:, 3:7])
    x[:, 0:3] += R @ center
    x[:, 7:10] += np.einsum("sij,sj->si", R, np.cross(x[:, 10:13], center))
    thrust, forces = model.wrench(v)
    out, h = [x], s.step / SUBSTEPS
    for k in range(steps):
        held = tuple(part[first + k] for part in (thrust, *forces))
        for _ in range(SUBSTEPS):
            x = _step(model, v, x, held, h)
        out.append(x)
    states_out = np.array(out)
    R = attitude.rotation_matrix(states_out[..., 3:7])
    turned = np.cross(states_out[..., 10:13], center)
    states_out[..., 0:3] -= R @ center
    states_out[..., 7:10] -= np.einsum("ksij,ksj->ksi", R, turned)
    rows = s.edges[first[None, :] + np.arange(steps + 1)[:, None]]
    return Prediction(np.arange(steps + 1) * s.step, first, states_out, rows)


def _step(model: FlightModel, v: Values, x: np.ndarray, held: tuple, h: float) -> np.ndarray:
    """Return states (s, 13) one Runge-Kutta step later."""
    one = _rate(model, v, x, held)
    two = _rate(model, v, x + 0.5 * h * one, held)
    three = _rate(model, v, x + 0.5 * h * two, held)
    four = _rate(model, v, x + h * three, held)
    out = x + h / 6 * (one + 2 * two + 2 * three + four)
    out[:, 3:7] /= np.linalg.norm(out[:, 3:7], axis=1, keepdims=True)
    return out


def _rate(model: FlightModel, v: Values, x: np.ndarray, held: tuple) -> np.ndarray:
    """Return the rates of change (s, 13) of states x (s, 13), of the centre of mass."""
    thrust, moment, spin, change, mean = held
    q, w = x[:, 3:7], x[:, 10:13]
    u = attitude.rotate_back(q, x[:, 7:10])
    air, torque = model.air_wrench(v, u, mean)
    push = air.copy()
    push[:, 2] += thrust
    a = attitude.rotate(q, push) - [0.0, 0.0, G]
    j = inertia(v) * model.frame.arm**2
    total = moment + torque - np.cross(w, w @ j.T)
    h = v["rotor_momentum"] * j[2, 2] * spin
    total[:, 0] += w[:, 1] * h
    total[:, 1] -= w[:, 0] * h
    total[:, 2] += v["rotor_momentum"] * j[2, 2] * change
    return np.concatenate(
        [x[:, 7:10], attitude.quaternion_rate(q, w), a, total @ np.linalg.inv(j).T], axis=1
    )
