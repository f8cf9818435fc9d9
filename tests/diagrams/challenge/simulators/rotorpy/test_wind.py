from functools import partial

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.challenge.simulators.rotorpy import simulator
from diagrams.challenge.simulators.rotorpy.wind import Gusts
from np_drake.effects.base import Motion
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels

# The laws hold from any start; a settled one only takes longer.
fly = partial(simulator.fly, warm_up=0.5)  # [s]

DRAG = LIBRARY["linear_drag"](0.4, 0.4, 0.4)


def gusty(seed):
    return LIBRARY["gusty_wind"](2.0, -1.0, 0.5, deviation=0.8, correlation_time=0.6, seed=seed)


def blown(profile, t):
    return np.array([profile.update(now, np.zeros(3)) for now in t])


def test_gusts_have_their_mean_deviation_and_correlation_time():
    air = blown(Gusts(gusty(3)), np.arange(0, 300, 0.02))
    np.testing.assert_allclose(
        air.mean(axis=0), [2.0, -1.0, 0.5], atol=0.2
    )  # of 250 independent gusts
    np.testing.assert_allclose(air.std(axis=0), 0.8, rtol=0.15)
    gust = air - air.mean(axis=0)
    later = np.mean(gust[30:] * gust[:-30]) / np.mean(gust**2)
    assert later == pytest.approx(np.exp(-1), abs=0.1)


def test_gusts_push_through_the_drag(vehicle, plan, t):
    log = fly(vehicle, plan, [gusty(1), DRAG], t=t)
    air = blown(Gusts(gusty(1)), t)
    chi = DRAG.wrench(vehicle, Motion(t, log.x, log.u @ vehicle.unmixer.T, air))
    np.testing.assert_allclose(raw_labels(log, vehicle), chi, atol=1e-9)  # [N]


def test_gusts_differ_by_seed_alone():
    t = np.arange(0, 3, 0.05)
    np.testing.assert_array_equal(blown(Gusts(gusty(1)), t), blown(Gusts(gusty(1)), t))
    assert np.abs(blown(Gusts(gusty(1)), t) - blown(Gusts(gusty(2)), t)).max() > 0.5
