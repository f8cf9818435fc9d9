"""Structure that no effect explains: generic groups of columns compete for what is left.

Each group says something about where the structure lives: with the motion, at a place, with the command, at a
frequency, in a time. The groups are judged by the same Bayesian evidence as effects.   Source: own choice of groups.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np
from scipy import signal

from np_drake import attitude
from np_drake.diagnosis import evidence as ev
from np_drake.diagnosis.evidence import Evidence, low_pass
from np_drake.diagnosis.grid import to_grid
from np_drake.diagnosis.linear_bayes import gram
from np_drake.diagnosis.noise import NoiseModel

PRIOR = 0.03  # deviation of a group's force over weight, and of its torque over weight times arm [1]
RESONANCES = (0.5, 0.8, 1.2, 1.8, 2.7, 4.0)  # [Hz]
DRIVE_BAND = 4.0  # of the specific force that drives a resonance; from velocity, whose noise is not the force's [Hz]
CENTRES = 12  # of a place


@dc.dataclass(frozen=True)
class Trace:
    """One group's verdict. gain: log evidence; held_out: log likelihood it brings on unseen flights; share: of the

    remaining power in force and torque (whitened) that it explains; figures: frequency [Hz], damping [1], …
    """

    name: str
    text: str
    gain: float
    held_out: float
    share: float
    force: float
    torque: float
    figures: dict[str, float] = dc.field(default_factory=dict)
    repeats: bool = True  # would show in an unseen flight alike


@dc.dataclass(frozen=True)
class State:
    """On the grid: v (m, 3) and p (m, 3) in B and W, w (m, 3), u (m, 4) nominal wrench, R (m, 3, 3), s (m, 3)."""

    v: np.ndarray
    p: np.ndarray
    w: np.ndarray
    u: np.ndarray
    R: np.ndarray
    s: np.ndarray
    t: np.ndarray
    step: float


def state_of(evidence: Evidence) -> State:
    """Of one flight."""
    mids = evidence.mids
    v = to_grid(evidence.grid, mids.t, attitude.rotate_back(mids.q, mids.x[:, 7:10]))
    p = to_grid(evidence.grid, mids.t, mids.x[:, :3])
    R = to_grid(evidence.grid, mids.t, attitude.rotation_matrix(mids.q))
    log = evidence.log
    g = np.array([0.0, 0.0, evidence.vehicle.gravity])
    rate = low_pass(np.diff(log.v, axis=0) / np.diff(log.t)[:, None], log.step, DRIVE_BAND)
    s = to_grid(evidence.grid, mids.t, attitude.rotate_back(mids.q, rate + g))
    return State(v, p, evidence.w, evidence.nominal[:, 2:], R, s, evidence.t, evidence.grid.step)


Features = Callable[[State], np.ndarray]  # (m, k) scalars, each free in all six channels


def _motion(s: State) -> np.ndarray:
    v, w = s.v / 2.0, s.w / 1.0
    speed = np.linalg.norm(v, axis=1, keepdims=True)
    pairs = [v[:, i] * v[:, j] for i in range(3) for j in range(i, 3)]
    return np.concatenate([v, speed * v, speed**2 * v, np.stack(pairs, axis=1)], axis=1)


def _rates(s: State) -> np.ndarray:
    v, w = s.v / 2.0, s.w / 1.0
    pairs = [w[:, i] * w[:, j] for i in range(3) for j in range(i, 3)]
    return np.concatenate([w, np.abs(w) * w, np.cross(w, v), np.stack(pairs, axis=1)], axis=1)


def _command(s: State) -> np.ndarray:
    f = s.u[:, :1] / np.mean(s.u[:, 0]) - 1
    tau = s.u[:, 1:] / (np.std(s.u[:, 1:]) + 1e-6)
    rate = np.gradient(np.concatenate([4 * f, tau], axis=1), axis=0) / s.step / 10
    return np.concatenate(
        [4 * f, 8 * f**2, 16 * f**3, tau, np.abs(tau) * tau / 2, f * tau, rate, np.sign(rate) * 0.5], axis=1
    )


def _height(s: State) -> np.ndarray:
    z = np.maximum(s.p[:, 2:], 0.05)
    return np.concatenate([np.exp(-z / 0.3), np.exp(-z), z / 2], axis=1)


def _place(centres: np.ndarray, width: float) -> Features:
    def features(s: State) -> np.ndarray:
        d2 = np.sum((s.p[:, None] - centres[None]) ** 2, axis=2)
        return np.exp(-0.5 * d2 / width**2)

    return features


def _resonance(frequency: float, damping: float) -> Features:
    def features(s: State) -> np.ndarray:
        omega = 2 * np.pi * frequency
        system = signal.cont2discrete(
            ([omega**2], [1.0, 2 * damping * omega, omega**2]), s.step, method="bilinear"
        )
        drive = np.concatenate([s.s - s.s.mean(axis=0), s.w], axis=1) / 2.0
        answer = signal.lfilter(system[0].ravel(), system[1], drive, axis=0)
        lagged = signal.lfilter([1.0 / s.step, -1.0 / s.step], [1.0], answer, axis=0) / omega
        return np.concatenate([answer, lagged], axis=1) * damping * 2

    return features


def _spread(features: np.ndarray, evidence: Evidence) -> np.ndarray:
    """(m, 15, 6 k): every feature free in every channel of the wrench, at the prior's size."""
    vehicle = evidence.vehicle
    weight = vehicle.mass * vehicle.gravity
    arm = float(np.mean(np.linalg.norm(np.array(vehicle.rotor_positions), axis=1)))
    size = PRIOR * weight * np.array([1.0, 1.0, 1.0, 0.3 * arm, 0.3 * arm, 0.1 * arm])
    k = features.shape[1]
    X = np.zeros((*evidence.y.shape, 6 * k))
    for c in range(6):
        X[:, c, c * k : (c + 1) * k] = size[c] * features
    return X


def _in_world(columns: np.ndarray, R: np.ndarray, k: int) -> np.ndarray:
    """Force columns turned: free in the axes of W instead of B."""
    X = np.array(columns)
    for j in range(k):
        block = np.stack([columns[:, c, c * k + j] for c in range(3)], axis=1)
        for c in range(3):
            X[:, :3, c * k + j] = R[:, c, :] * block[:, c : c + 1]
    return X


def groups(flights: Sequence[Evidence]) -> list[tuple[str, str, Callable[[Evidence], np.ndarray], dict[str, float]]]:
    """(name, what it means, columns of a flight, figures) of every group."""
    states = {e.name: state_of(e) for e in flights}
    p = np.concatenate([states[e.name].p for e in flights])
    span = float(np.linalg.norm(p.std(axis=0))) + 1e-3
    pick = np.linspace(0, len(p) - 1, 40 * CENTRES).astype(int)
    from scipy.cluster.vq import kmeans2

    centres, _ = kmeans2(p[pick], CENTRES, seed=1, minit="++")
    found: list = []

    def add(name: str, text: str, features: Features, figures=None, world: bool = False) -> None:
        def columns(e: Evidence) -> np.ndarray:
            state = states.setdefault(e.name, state_of(e))
            raw = features(state)
            X = _spread(raw, e)
            return _in_world(X, state.R, raw.shape[1]) if world else X

        found.append((name, text, columns, figures or {}))

    add("motion", "goes with velocity", _motion)
    add("rates", "goes with body rates", _rates)
    add("command", "goes with the command", _command)
    add("height", "goes with height", _height)
    add("place", "is tied to a place", _place(centres, 0.7 * span), world=True)
    for f in RESONANCES:
        add(
            "resonance",
            f"answers the motion with a resonance near {f:g} Hz",
            _resonance(f, 0.1),
            {"frequency": f, "damping": 0.1},
        )
    return found


def traces(
    flights: Sequence[Evidence],
    left: dict[str, np.ndarray],
    noise: NoiseModel,
    *,
    temperature: float,
    held_out: Sequence[Evidence] = (),
    nuisance: dict[str, np.ndarray] | None = None,
) -> list[Trace]:
    """All groups on what is left (m, 15) of the training flights, best first; scored on held-out flights.

    nuisance: (m, 15, k) by flight, columns that may readjust (the fitted effects' own derivatives).
    """
    out = []
    for name, text, columns, figures in groups(flights):
        total = None
        for e in flights:
            X = columns(e)
            if nuisance is not None:
                X = np.concatenate([nuisance[e.name], X], axis=-1)
            g = gram(noise.whiten(X), noise.whiten(left[e.name])).tempered(temperature)
            total = g if total is None else total + g
        k0 = 0 if nuisance is None else next(iter(nuisance.values())).shape[-1]
        everything = np.arange(len(total.Xy))
        gain = total.log_evidence(everything) - total.log_evidence(everything[:k0])
        mean, _ = total.posterior(everything)
        held = 0.0
        for e in held_out:
            g = gram(noise.whiten(columns(e)), noise.whiten(left[e.name])).tempered(temperature)
            held += 0.5 * (g.yy - g.residual(np.arange(len(g.Xy)), mean[k0:]))
        part = np.concatenate([columns(e) @ mean[k0:] for e in flights])
        y = np.concatenate([left[e.name] for e in flights])
        share = float(np.sum(noise.whiten(part)[:, ev.WRENCH] ** 2) / np.sum(noise.whiten(y)[:, ev.WRENCH] ** 2))
        force = float(np.sqrt(np.mean(np.sum(part[:, ev.FORCE] ** 2, axis=1))))
        torque = float(np.sqrt(np.mean(np.sum(part[:, ev.TORQUE] ** 2, axis=1))))
        out.append(Trace(name, text, float(gain), float(held), share, force, torque, figures))
    return sorted(out, key=lambda t: -t.gain)
