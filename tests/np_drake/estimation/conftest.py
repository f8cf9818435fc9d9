"""A flight whose every figure is known: tumbling gently, thrust along body z and a drag."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.estimation.motion import ARRAY_GRAVITY
from np_drake.logs.formats.neurobem import published_vehicle
from np_drake.training_data.segments import WrenchSequence

STEP = 0.0025


@dc.dataclass(frozen=True)
class Made:
    """The arrays, the attitude that they leave out."""

    sequence: WrenchSequence
    q: np.ndarray


@pytest.fixture(scope="session")
def vehicle():
    return published_vehicle()


@pytest.fixture(scope="session")
def made(vehicle) -> Made:
    """Integrated with 20 substeps a row; begins as a hover."""
    n, substeps = 1600, 20
    h, J = STEP / substeps, vehicle.J
    q, v, w = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)
    rows = []
    for k in range(n * substeps):
        t = k * h
        rise = 1 - np.exp(-t / 0.3)
        tau = rise * np.array([0.004, 0.003, 0.002]) * np.sin([5 * t, 7 * t, 3 * t + 1])
        s = np.array([0.0, 0.0, 9.81 + 2 * rise * np.sin(4 * t)]) - 0.3 * attitude.rotate_back(q, v)
        if k % substeps == 0:
            f = vehicle.mass * (s - [0.0, 0.0, ARRAY_GRAVITY])
            rows.append([*attitude.rotate_back(q, v), *w, *f, *tau, *q])
        v = v + h * (attitude.rotate(q, s) - [0.0, 0.0, vehicle.gravity])
        w = w + h * np.linalg.solve(J, tau - np.cross(w, J @ w))
        q = q + h * attitude.quaternion_rate(q, w)
        q = q / np.linalg.norm(q)
    data = np.array(rows)
    sequence = WrenchSequence(STEP, data[:, 6:12], data[:, :6], "body", "made", total=True).check()
    return Made(sequence, data[:, 12:])
