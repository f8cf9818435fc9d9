"""A small flight to train on: taut payload below a quadrotor on a circle or lemniscate, drag, noisy
labels.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.training_data.segments import Segment

STEP, MASS, LOAD, LENGTH, HOOK, G = 0.02, 2.0, 0.26, 0.8, 0.025, 9.81
DRAG, THRUST, LAG = 0.25, 0.96, 0.08  # [N·s/m], real over nominal [1], of the attitude loop [s]
UP = np.array([0.0, 0.0, 1.0])


@dc.dataclass(frozen=True)
class Flight:
    """chi: (n, 6) causal labels.   zeta: (n, 6) measured.   truth: (n, 6) wrench [N, N·m]."""

    chi: np.ndarray
    zeta: np.ndarray
    truth: np.ndarray

    @property
    def segment(self) -> Segment:
        """For training, the truth as target (a zero-phase label comes close to it)."""
        return Segment(self.chi, self.zeta, STEP, self.truth)


def reference(path: str, dither: float, generator: np.random.Generator):
    """p, v, a of the reference as a function of time: 1.5 m/s circle, or lemniscate; multisine
    dither [m/s].
    """
    phase = generator.uniform(0, 2 * np.pi, (3, 5))
    rate = 2 * np.pi * np.array([0.23, 0.41, 0.67, 0.97, 1.31])

    def at(t: float):
        c, s = np.cos(rate * t + phase), np.sin(rate * t + phase)
        shake = dither * np.array([(s / rate).sum(1), c.sum(1), -(s * rate).sum(1)])
        w = 1.5 if path == "circle" else 0.9
        cos, sin, cos2, sin2 = np.cos(w * t), np.sin(w * t), np.cos(2 * w * t), np.sin(2 * w * t)
        x, y = (1.0, 0.0) if path == "circle" else (1.5, 0.75)
        p = [x * cos, sin + 0 * t if path == "circle" else y * sin2, 1.6]
        v = [-x * w * sin, w * cos if path == "circle" else 2 * y * w * cos2, 0.0]
        a = [-x * w * w * cos, -w * w * sin if path == "circle" else -4 * y * w * w * sin2, 0.0]
        return np.array([p, v, a]) + shake

    return at


def acceleration(s: np.ndarray) -> tuple[np.ndarray, float]:
    """Acceleration of the quadrotor [m/s²] and tension [N]. State s: p, v, cable direction and its
    rate, thrust.
    """
    v, q, rate, F = s[3:6], s[6:9], s[9:12], s[12:15]
    inertia = MASS * np.eye(3) + LOAD * np.outer(q, q)
    a = np.linalg.solve(
        inertia, F - MASS * G * UP - DRAG * v + LOAD * q * (LENGTH * rate @ rate - q[2] * G)
    )
    return a, LOAD * (LENGTH * rate @ rate - q @ (a + G * UP))


def derivative(s: np.ndarray, command: np.ndarray) -> np.ndarray:
    """ds/dt under a commanded thrust vector [N]."""
    a, tension = acceleration(s)
    q, rate = s[6:9], s[9:12]
    bend = (-(a + G * UP) - tension / LOAD * q) / LENGTH - 0.05 * rate
    return np.concatenate([s[3:6], a, rate, bend, (THRUST * command - s[12:15]) / LAG])


def advance(s: np.ndarray, command: np.ndarray) -> np.ndarray:
    """One sample on: two Runge-Kutta steps, the cable direction back to unit length."""
    h = STEP / 2
    for _ in range(2):
        k1 = derivative(s, command)
        k2 = derivative(s + h / 2 * k1, command)
        k3 = derivative(s + h / 2 * k2, command)
        s = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + derivative(s + h * k3, command))
        q = s[6:9] / np.linalg.norm(s[6:9])
        s[6:9], s[9:12] = q, s[9:12] - q * (q @ s[9:12])
    return s


def fly(path: str, *, duration: float, seed: int, dither: float = 0.0) -> Flight:
    """A flight with PD control that compensates a 2 Hz low-passed label; label noise 0.2 N,
    low-passed at 6 Hz.
    """
    generator = np.random.default_rng(seed)
    at, n = reference(path, dither, generator), int(duration / STEP)
    chi, zeta, truth = np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((n, 6))
    s = np.concatenate([*at(0.0)[:2], -UP, np.zeros(3), (MASS + LOAD) * G * UP])
    command, hold, label = s[12:15] / THRUST, -LOAD * G * UP, None
    blend, slow = 1 - np.exp(-2 * np.pi * 6.0 * STEP), 1 - np.exp(-2 * np.pi * 2.0 * STEP)
    for k in range(n):
        a, tension = acceleration(s)
        F = s[12:15]
        truth[k, :3] = MASS * (a + G * UP) - F / THRUST
        truth[k, 3:] = np.cross(-HOOK * UP, tension * s[6:9])
        raw = truth[k] + np.repeat([0.2, 0.02], 3) * generator.standard_normal(6)
        chi[k] = label = raw if label is None else label + blend * (raw - label)
        tilting = np.cross(F, THRUST * command - F) / LAG / (F @ F)
        zeta[k] = np.concatenate([s[3:6], tilting]) + 0.01 * generator.standard_normal(6)
        hold = hold + slow * (chi[k, :3] - hold)
        p, v, feed = at(k * STEP)
        seen = s[:3] + 1e-3 * generator.standard_normal(3)
        command = MASS * (feed + 6 * (p - seen) + 4 * (v - zeta[k, :3]) + G * UP) - hold
        s = advance(s, command)
    return Flight(chi, zeta, truth)


@pytest.fixture(scope="session")
def dithered() -> Flight:
    """60 s circle, a little dither on the reference."""
    return fly("circle", duration=60.0, seed=0, dither=0.04)


@pytest.fixture(scope="session")
def plain() -> Flight:
    """60 s plain circle."""
    return fly("circle", duration=60.0, seed=1)


@pytest.fixture(scope="session")
def lemniscate() -> Flight:
    """20 s of a path that no training has seen."""
    return fly("lemniscate", duration=20.0, seed=2)
