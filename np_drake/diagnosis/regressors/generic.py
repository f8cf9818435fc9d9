"""Generic structure: groups of columns, each of one signal, that compete with the library for the
same evidence.

Source: own choice of groups.
"""

import dataclasses as dc
import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial

import numpy as np
import scipy

from np_drake import attitude
from np_drake.diagnosis.options import Priors
from np_drake.diagnosis.regressors.library_regressors import Candidate
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.effects.base import arm
from np_drake.rigid_body import P, V

PREFIX = "unknown:"
RESONANCES = (0.4, 0.6, 0.8, 1.05, 1.4, 1.8, 2.4, 3.2, 4.2)  # [Hz]
DAMPING = 0.1  # damping of the resonances in the grids [1]
# frequencies of resonances between command and torque [Hz]
TWISTS = tuple(0.7 * 1.3**k for k in range(9))
ELSEWHERE = "the same trajectory, moved by a metre"  # ends a force tied to a place
CENTRES = 10  # number of centres of the position group
GROUPS = {  # what each is, and the measurement that would end it
    "rates": (
        "a torque that goes with body rates",
        "doublets about each axis, then the same at twice the rate",
    ),
    "side force": (
        "a force across velocity and body rate",
        "level turns at one speed, to the left and to the right",
    ),
    "velocity": (
        "a force and torque that go with velocity",
        "the same trajectory at twice the speed",
    ),
    "cross flow": (
        "a force that goes with the product of two velocities",
        "the same straight leg with headings 45° apart",
    ),
    "thrust curve": (
        "thrust that is no straight line of {thrust}",
        "hover with a known weight, then without it",
    ),
    "command": (
        "torque that goes with {other} of another axis",
        "doublets about one axis at a time",
    ),
    "height": ("a force that goes with height", "hover at three heights, 5 s each"),
    "place": ("a force tied to a place", ELSEWHERE),
}
WORDS = {"thrust": "its command", "other": "the command", "torque": "the commanded torque"}
ROTOR_WORDS = {
    "thrust": "the square of rotor speed",
    "other": "that",
    "torque": "the torque of the rotors",
}
# Variance of an axis over that of its noise, below which it is no regressor [1]; own choice.
LEAST_SIGNAL_TO_NOISE = 4.0


class FlightState:
    """State of a flight on its grid, with noise removed from velocity and body rates.

    v, w (m, 3): velocity and body rates in B [m/s, rad/s]; p (m, 3): position in W [m]; R (m, 3,
    3): R_WB. u (m, 4): nominal thrust and torques [N, N·m]; rotor (m, 4): nominal rotor thrusts
    [N]. torque_unit (3,): lever arms that scale torque priors [m]; weight [N]; gravity [m/s²]; step
    [s].
    """

    def __init__(self, flight: FlightResiduals):
        self.vehicle = flight.vehicle
        self.weight = flight.weight
        self.gravity = flight.vehicle.gravity
        self.step = flight.grid.step
        v_B = attitude.rotate_back(flight.mids.q, flight.wrench_states[1][:, V])
        self.v = _above_noise(flight.from_mids(v_B), flight.log.v)
        self.w = _above_noise(flight.w, flight.log.w)
        self.p = flight.from_mids(flight.mids.x[:, P])
        self.R = flight.from_mids(attitude.rotation_matrix(flight.mids.q))
        self.u = flight.nominal[:, 2:]
        self.rotor = self.u @ flight.vehicle.unmixer.T
        self.torque_unit = arm(flight.vehicle) * np.array([0.3, 0.3, 0.1])


def _above_noise(values: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Return values (m, 3) with each axis shrunk by its share of signal, given the white noise of
    the readings (n, 3).

    The noise is the mean over the three axes, because v is rotated from W to B.
    Source: Wiener gain.
    """
    # second differences have six times the variance
    noise = np.mean(np.diff(read, n=2, axis=0) ** 2) / 6.0
    return values * np.clip(
        1 - LEAST_SIGNAL_TO_NOISE * noise / np.maximum(values.var(axis=0), 1e-12), 0.0, 1.0
    )


# (m, 6, k) force and torque in B in units of their prior
Pushes = Callable[[FlightState], np.ndarray]


def generic_candidates(flights: Sequence[FlightResiduals], priors: Priors) -> list[Candidate]:
    """Return all groups as candidates; their `generic` gives the columns on any flight."""
    states = {flight.name: FlightState(flight) for flight in flights}
    lacks = {quantity for flight in flights for quantity in flight.log.lacks}
    measured = flights[0].log.input == "rotor_speed"
    words = ROTOR_WORDS if measured else WORDS
    candidates = []
    for name, pushes, needed in (
        ("rates", _damping, ""),
        ("side force", _side_force, "velocity"),
        ("velocity", _velocity, "velocity"),
        ("cross flow", _cross_flow, "velocity"),
        ("thrust curve", _thrust_curve, ""),
        ("command", _coupling, ""),
        ("height", _height, "height"),
        ("place", _place(states), "height"),
    ):
        if needed not in lacks:
            text, measurement = GROUPS[name]
            group = _group(name, text.format(**words), measurement)
            candidates.append(_with_columns(group, flights, states, priors, pushes))
    loose = "the same trajectory with battery, cables and loose parts taped down"
    still = loose if measured else "log rotor speed on the same trajectory"
    for name, driven, measurement, frequencies, resonance in (
        (
            "resonance",
            "the motion",
            "a flight without payload, cables and loose parts",
            () if "attitude" in lacks else RESONANCES,
            _resonance,
        ),
        ("twist", words["torque"], still, TWISTS, partial(_twist, priors=priors)),
    ):
        for f in frequencies:
            text = f"an answer to {driven} with a resonance near {f:.3g} Hz"
            group = dc.replace(
                _group(name, text, measurement),
                log_prior=-math.log(len(frequencies)),
                figures={"frequency": f},
            )
            candidates.append(_with_columns(group, flights, states, priors, resonance(f)))
    return candidates


def _group(name: str, text: str, measurement: str) -> Candidate:
    """Return a group without columns: what it is, and the measurement that would end it."""
    return Candidate((PREFIX + name,), text, {}, lambda c: [], measurement=measurement)


def _with_columns(
    group: Candidate,
    flights: Sequence[FlightResiduals],
    states: dict[str, FlightState],
    priors: Priors,
    pushes: Pushes,
) -> Candidate:
    """Return a group with its columns on these flights, and a function for any other."""

    def columns(flight: FlightResiduals) -> np.ndarray:
        state = states.get(flight.name) or FlightState(flight)
        size = priors.generic_size * flight.weight * np.append(np.ones(3), state.torque_unit)
        unscaled = pushes(state)
        X = np.zeros((*flight.y.shape, unscaled.shape[-1]))
        X[:, WRENCH] = size[:, None] * unscaled
        return X

    by_flight = {flight.name: columns(flight) for flight in flights}
    return dc.replace(group, columns=by_flight, generic=columns)


def _each(features: np.ndarray, channels: Sequence[int]) -> np.ndarray:
    """Return columns (m, 6, k len(channels)) in which every feature (m, k) acts freely in each of
    the channels.
    """
    m, k = features.shape
    out = np.zeros((m, 6, k * len(channels)))
    for j, c in enumerate(channels):
        out[:, c, j * k : (j + 1) * k] = features
    return out


def _damping(s: FlightState) -> np.ndarray:
    squares = np.abs(s.w) * s.w
    return np.concatenate(
        [_each(np.stack([s.w[:, i], squares[:, i]], axis=1), [3 + i]) for i in range(3)], axis=2
    )


def _side_force(s: FlightState) -> np.ndarray:
    across = np.cross(s.w, s.v) / 2.0
    return np.concatenate([_each(across[:, i : i + 1], [i]) for i in range(3)], axis=2)


VELOCITY_COLUMNS = 6  # of each axis of force: velocity and its cube along x, y and z


def _velocity(s: FlightState) -> np.ndarray:
    v = s.v / 2.0
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    force = _each(np.concatenate([v, speed**2 * v], axis=1), [0, 1, 2])
    torque = _each(np.concatenate([v, speed * v], axis=1), [3, 4, 5])
    return np.concatenate([force, torque], axis=2)


def _cross_flow(s: FlightState) -> np.ndarray:
    """Return products |v_i| v_j of two different axes, each free along all three."""
    v = s.v / 2.0
    products = [np.abs(v[:, i]) * v[:, j] for i in range(3) for j in range(3) if i != j]
    return _each(np.stack(products, axis=1), [0, 1, 2])


def _thrust_curve(s: FlightState) -> np.ndarray:
    """Return square and cube of every rotor's relative thrust, the same curve for all four
    rotors.
    """
    relative = s.rotor / s.rotor.mean() - 1
    powers = np.stack([relative**2, relative**3], axis=2)
    u = np.einsum("ij,mjk->mik", s.vehicle.mixer, powers)
    out = np.zeros((len(u), 6, 2))
    out[:, 2] = 4 * u[:, 0]
    out[:, 3:] = u[:, 1:] * (1.0 / s.torque_unit)[:, None]
    return out


def _coupling(s: FlightState) -> np.ndarray:
    f = 4 * (s.u[:, :1] / np.mean(s.u[:, 0]) - 1)
    rate = np.gradient(f, axis=0) / s.step / 8
    tau = s.u[:, 1:] / (np.std(s.u[:, 1:], axis=0) + 1e-9)
    parts = [_each(np.concatenate([f, rate], axis=1), [3, 4, 5])]
    for i in range(3):
        direction = np.sign(np.gradient(tau[:, i]))[:, None] * 0.5
        parts.append(_each(np.concatenate([np.delete(tau, i, axis=1), direction], axis=1), [3 + i]))
    return np.concatenate(parts, axis=2)


def _height(s: FlightState) -> np.ndarray:
    z = np.maximum(s.p[:, 2:], 0.05)
    return _each(np.concatenate([np.exp(-z / 0.3), np.exp(-z), z / 2, (z / 2) ** 2], axis=1), [2])


def _place(states: dict[str, FlightState]) -> Pushes:
    """Return Gaussian bumps about centres from k-means on the positions, each with a force in W."""
    p = np.concatenate([s.p for s in states.values()])
    width = 0.8 * float(np.sqrt(np.mean(p.var(axis=0)))) + 0.05
    pick = p[np.linspace(0, len(p) - 1, 40 * CENTRES).astype(int)]
    centres, _ = scipy.cluster.vq.kmeans2(pick, CENTRES, seed=1, minit="++")

    def pushes(s: FlightState) -> np.ndarray:
        bells = np.exp(-0.5 * np.sum((s.p[:, None] - centres) ** 2, axis=2) / width**2)
        out = np.zeros((len(bells), 6, 3 * CENTRES))
        for c in range(3):
            out[:, :3, c * CENTRES : (c + 1) * CENTRES] = s.R[:, c, :, None] * bells[:, None, :]
        return out

    return pushes


@lru_cache(maxsize=32)
def _oscillator(omega: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return numerator and denominator of w² / (s² + 2 z w s + w²), discretised at `step` [s]."""
    b, a, _ = scipy.signal.cont2discrete(
        ([omega**2], [1.0, 2 * DAMPING * omega, omega**2]), step, method="bilinear"
    )
    return b.ravel(), a


def _resonance(frequency: float) -> Pushes:
    """Return the response of a lightly damped resonance to the motion: force along an axis, torque
    across.

    Each has two phases. The input is the acceleration that the command gives: the measured one
    would explain itself.
    """
    omega = 2 * np.pi * frequency

    def pushes(s: FlightState) -> np.ndarray:
        b, a = _oscillator(omega, s.step)
        drive = s.R[:, :, 2] * (s.u[:, :1] / s.weight * s.gravity)
        answer = scipy.signal.lfilter(b, a, (drive - drive.mean(axis=0)) / 2.0, axis=0)
        lagged = scipy.signal.lfilter([1.0 / s.step, -1.0 / s.step], [1.0], answer, axis=0) / omega
        pair = 2 * DAMPING * (np.swapaxes(s.R, 1, 2) @ np.stack([answer, lagged], axis=2))
        along = ((0, 0), (1, 1), (2, 2), (0, 4), (1, 3))
        return np.concatenate([_each(pair[:, i], [channel]) for i, channel in along], axis=2)

    return pushes


def _twist(frequency: float, priors: Priors) -> Pushes:
    """Return the torque of a lightly damped resonance that the commanded torque drives, separately
    for every axis.

    With G = w² / (D² + 2 z w D + w²) the columns are G, D G / w, G² and D G² / w: its derivatives
    by w and z.
    """
    omega = 2 * np.pi * frequency

    def pushes(s: FlightState) -> np.ndarray:
        b, a = _oscillator(omega, s.step)
        rest = scipy.signal.lfilter_zi(b, a)[:, None]

        def behind(drive: np.ndarray) -> np.ndarray:
            return scipy.signal.lfilter(b, a, drive, axis=0, zi=rest * drive[:1])[0]

        once = behind(
            priors.twist_torque * s.u[:, 1:] / (priors.generic_size * s.weight * s.torque_unit)
        )
        twice = behind(once)
        changes = [np.gradient(g, s.step, axis=0) / omega for g in (once, twice)]
        peak = 2 * DAMPING  # normalises the peak of G to one
        parts = np.stack(
            [peak * once, peak * changes[0], peak**2 * twice, peak**2 * changes[1]], axis=2
        )
        return np.concatenate([_each(parts[:, i], [3 + i]) for i in range(3)], axis=2)

    return pushes
