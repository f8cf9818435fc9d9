"""rotorpy's vehicle: conversion of states, tether, gusts."""

import dataclasses as dc
from functools import partial

import numpy as np
import pytest

pytest.importorskip("rotorpy", reason="rotorpy is not installed: pip install 'np_drake[challenge]'")

from diagrams.evidence.challenge import flight
from diagrams.evidence.challenge.plans import draw_plan
from diagrams.evidence.challenge.rotorpy_vehicle import (
    SPEED,
    Gusts,
    Tether,
    from_rotorpy,
    to_rotorpy,
)
from np_drake.effects.base import Motion
from np_drake.effects.library import LIBRARY
from np_drake.effects.pendulum import hook_acceleration, hook_velocity
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.labels import raw_labels

fly = partial(flight.fly, simulation=flight.Simulation("rotorpy", warm_up=0.5))  # [s]

EFFECT = SuspendedPayload(0.3, 0.7, 0.01, -0.01, -0.03)
GRAVITY = 9.81


def hung_up():
    """A hook that is held at the origin, where it points whichever way the world does."""
    return Motion(0.0, np.eye(13)[3], np.zeros(4))


def swing(tether, own, seconds, step=0.002):
    """(n, 6) states of the payload under a hook that nothing moves, by the midpoint rule."""
    wall = (1e12, np.eye(3) * 1e-12, np.zeros(3))
    states = [own]
    for _ in range(round(seconds / step)):
        _, rate = tether.pull(hung_up(), own, np.zeros(6), wall, GRAVITY)
        _, rate = tether.pull(hung_up(), own + 0.5 * step * rate, np.zeros(6), wall, GRAVITY)
        own = own + step * rate
        states.append(own)
    return np.array(states)


PAYLOAD = SuspendedPayload(0.3, 0.7, 0.0, 0.0, 0.0)


@pytest.fixture
def dut():
    return Tether(PAYLOAD)


def test_a_small_swing_has_the_pendulums_period_and_keeps_its_energy(dut):
    way = 0.7 * np.array([np.sin(0.05), 0.0, -np.cos(0.05)])
    states = swing(dut, np.append(way, np.zeros(3)), 10.0)
    crossings = np.flatnonzero(np.diff(np.sign(states[:, 0])) > 0)
    period = 2 * np.pi * np.sqrt(0.7 / GRAVITY)
    assert np.diff(crossings).mean() * 0.002 == pytest.approx(period, rel=2e-3)
    assert states[-2000:, 0].max() == pytest.approx(way[0], rel=2e-2)


def test_a_slack_payload_falls_freely_and_is_caught_at_the_tethers_end(dut):
    states = swing(dut, np.array([0.3, 0.0, 0.2, 0.5, 0.0, 0.0]), 2.0)
    t = 0.002 * np.arange(len(states))
    caught = int(np.argmax(np.linalg.norm(states[:, :3], axis=1) > 0.69))
    assert 0.1 < t[caught] < 0.6
    free = np.stack([0.3 + 0.5 * t, 0 * t, 0.2 - 0.5 * GRAVITY * t**2], axis=1)
    np.testing.assert_allclose(states[: caught - 5, :3], free[: caught - 5], atol=1e-4)
    # Stopped softly, within v / (e RATE) of the end.
    assert np.linalg.norm(states[:, :3], axis=1).max() < 0.7 + 4.0 / (np.e * 80.0)


@pytest.mark.parametrize("damping", [0.0, 0.5])
def test_a_payload_that_attaches_swings_as_the_effects_own(vehicle, damping):
    plan, effect = (
        draw_plan(np.random.default_rng(3), vehicle, 4.0, "aggressive_multisine"),
        dc.replace(EFFECT, damping=damping),
    )
    log = fly(vehicle, plan, [effect], t=np.arange(400) / 100, onset=0.5)
    chi, part = raw_labels(log, vehicle), slice(50, 400)
    np.testing.assert_allclose(chi[:50], 0.0, atol=1e-9)
    motion = {"x": log.x[part], "a": log.a[part], "al": log.al[part]}
    hook = hook_acceleration(effect.payload.hook, **motion)[0]
    hook += damping * hook_velocity(effect.payload.hook, log.x[50])
    # It begins at rest below the hook: the pull is that of its weight, of the hook's climb and of
    # the air.
    np.testing.assert_allclose(chi[50, :3], [0, 0, -0.3 * (GRAVITY + hook[2])], atol=1e-2)  # [N]
    own = effect.wrench_along(
        vehicle, **motion, step=0.01, r=np.array([0.0, 0.0, -0.7]), r_rate=np.zeros(3)
    )
    left = np.sqrt(np.mean((chi[part] - own) ** 2, axis=0))
    assert np.all(left < 0.01 * own.std(axis=0) + 1e-5)


CENTER = np.array([0.03, -0.02, 0.05])  # p_BoBcm_B [m]


def test_a_state_comes_back_as_it_was():
    rng = np.random.default_rng(0)
    x, speed = rng.normal(size=13), rng.uniform(100.0, 900.0, 4)
    x[3:7] /= np.linalg.norm(x[3:7])
    s = to_rotorpy(x, CENTER, speed)
    np.testing.assert_allclose(from_rotorpy(s, CENTER), x, atol=1e-14)
    np.testing.assert_array_equal(s[SPEED], speed)


def gusty(seed):
    return LIBRARY["gusty_wind"](2.0, -1.0, 0.5, deviation=0.8, correlation_time=0.6, seed=seed)


def test_gusts_have_their_mean_deviation_and_correlation_time():
    profile = Gusts(gusty(3))
    air = np.array([profile(now) for now in np.arange(0, 300, 0.02)])
    # Of 250 independent gusts.
    np.testing.assert_allclose(air.mean(axis=0), [2.0, -1.0, 0.5], atol=0.2)
    np.testing.assert_allclose(air.std(axis=0), 0.8, rtol=0.15)
    gust = air - air.mean(axis=0)
    later = np.mean(gust[30:] * gust[:-30]) / np.mean(gust**2)
    assert later == pytest.approx(np.exp(-1), abs=0.1)
