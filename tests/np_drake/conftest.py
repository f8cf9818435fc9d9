"""A made flight whose columns belong together."""

import numpy as np
import pytest

from np_drake.flight_log import FlightLog


def made_flight(n: int = 600, step: float = 0.01) -> FlightLog:
    """A circle of 1 m at 1.5 m/s with a rocking attitude, and its exact derivatives."""
    t = step * np.arange(n)
    phase = 1.5 * t
    turn = [np.cos(phase), np.sin(phase), 0 * t]
    p = np.stack([turn[0], turn[1], 1.6 + 0 * t], axis=1)
    v = 1.5 * np.stack([-turn[1], turn[0], 0 * t], axis=1)
    angle, rate = 0.4 * np.sin(2 * t), 0.8 * np.cos(2 * t)
    q = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * t, 0 * t], axis=1)
    w = np.stack([rate, 0 * t, 0 * t], axis=1)
    a = -2.25 * np.stack([turn[0], turn[1], 0 * t], axis=1)
    al = np.stack([-1.6 * np.sin(2 * t), 0 * t, 0 * t], axis=1)
    u = np.stack([20 + np.sin(t), 0.1 * np.cos(t), 0.02 * np.sin(3 * t), 0.01 + 0 * t], axis=1)
    rotor = 700 + 20 * np.stack([np.sin(t), np.cos(t), np.sin(2 * t), np.cos(2 * t)], axis=1)
    return FlightLog(t=t, p=p, q=q, v=v, w=w, u=u, a=a, al=al, rotor=rotor, name="made")


@pytest.fixture
def flight() -> FlightLog:
    return made_flight()
