import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.integrate import solve_ivp

from np_drake.effects import pendulum
from np_drake.effects.pendulum import Payload, hook_acceleration, swing, swing_many
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

GRAVITY = 9.81
WEIGHT = np.array([0, 0, GRAVITY])


def spherical(length, r, r_rate, hook, t):
    """Reference: (len(t), 3) specific pull of a taut pendulum under the hook acceleration hook(t)."""

    def pull(t, s):
        r, v = s[:3], s[3:]
        return r / length**2 * (v @ v - r @ (WEIGHT + hook(t)))

    def rate(t, s):
        return np.concatenate([s[3:], -pull(t, s) - hook(t) - WEIGHT])

    s = solve_ivp(rate, (0, t[-1]), np.concatenate([r, r_rate]), t_eval=t, rtol=1e-11, atol=1e-12).y.T
    return np.stack([pull(ti, si) for ti, si in zip(t, s, strict=True)])


def hook(t):
    return np.array([2 * np.sin(3 * t), 1.5 * np.cos(2 * t), np.sin(5 * t)])


def test_under_a_moving_hook_the_error_falls_with_the_square_of_the_step():
    length, r, r_rate = 0.7, 0.7 * np.array([0.6, 0, -0.8]), np.array([0.4, 1.0, 0.3])
    errors = []
    for step in (0.01, 0.005, 0.0025):
        t = step * (np.arange(round(2 / step)) + 0.5)
        a = np.stack([hook(ti) for ti in t])
        found = swing_many(np.array([length]), r[None], r_rate[None], a, step, GRAVITY)[:, 0]
        errors.append(np.abs(found - spherical(length, r, r_rate, hook, t)).max())
    assert errors[0] < 0.03  # [m/s²]
    np.testing.assert_allclose(np.array(errors[:-1]) / errors[1:], 4.0, rtol=0.2)


def some_pendulums(seed, m=5, n=200):
    rng = np.random.default_rng(seed)
    lengths, r = rng.uniform(0.2, 2, m), rng.normal(size=(m, 3))
    r *= (lengths * rng.uniform(0.2, 1.0, m) / np.linalg.norm(r, axis=1))[:, None]
    return lengths, r, rng.normal(size=(m, 3)), rng.normal(scale=4.0, size=(n, 3))


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6))
def test_many_pendulums_swing_as_each_does_alone(seed):
    lengths, r, r_rate, a = some_pendulums(seed)
    found = swing_many(lengths, r, r_rate, a, 0.004, GRAVITY)
    own_hooks = swing_many(lengths, r, r_rate, np.repeat(a[:, None], 5, axis=1), 0.004, GRAVITY)
    np.testing.assert_array_equal(own_hooks, found)
    for i in range(5):
        alone = swing(Payload(2.0, lengths[i]), r[i], r_rate[i], a, 0.004, GRAVITY)
        np.testing.assert_allclose(alone, 2.0 * found[:, i], rtol=1e-9, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_a_tether_only_pulls_and_is_never_longer_than_it_is(seed):
    lengths, r, r_rate, a = some_pendulums(seed)
    step = 0.004
    pull = swing_many(lengths, r, r_rate, a, step, GRAVITY)
    r, v = r + 0.5 * step * r_rate, r_rate  # what the payloads do under these pulls
    reach = np.linalg.norm(r, axis=1) / lengths
    r = r / np.maximum(reach, 1.0)[:, None]
    for p, a_hook in zip(pull, a, strict=True):
        assert (np.sum(p * r, axis=1) >= -1e-9).all()
        np.testing.assert_allclose(np.cross(p, r), 0.0, atol=1e-6)
        v = v - step * (p + a_hook + WEIGHT)
        r = r + step * v
        assert (np.linalg.norm(r, axis=1) <= lengths * (1 + 1e-9)).all()


def test_a_falling_hook_feels_nothing():
    r = np.array([[0.3, 0.0, -0.4]])
    found = swing_many(np.array([0.5]), r, np.zeros((1, 3)), np.tile(-WEIGHT, (100, 1)), 0.01, GRAVITY)
    np.testing.assert_allclose(found, 0.0, atol=1e-9)


def test_a_slack_tether_is_silent_until_it_snaps_and_then_stops_the_fall():
    drop, step = 0.3, 0.001  # hangs 0.5 m below a hook of 0.8 m
    found = swing(Payload(1.0, 0.8), np.array([0, 0, -0.5]), np.zeros(3), np.zeros((1000, 3)), step, GRAVITY)
    snap = np.sqrt(2 * drop / GRAVITY)
    pulled = np.flatnonzero(found[:, 2])
    assert pulled[0] * step == pytest.approx(snap, abs=2 * step)
    np.testing.assert_array_equal(found[: pulled[0]], 0.0)
    impulse = -found[pulled[0] : pulled[0] + 3, 2].sum() * step
    assert impulse == pytest.approx(GRAVITY * snap, abs=3 * GRAVITY * step)  # [m/s]: inelastic
    np.testing.assert_allclose(found[pulled[0] + 3 :, 2], -GRAVITY, rtol=1e-9)  # then it hangs


def test_a_conical_pendulum_keeps_its_tension():
    length, tilt = 0.8, 0.6
    r = length * np.array([np.sin(tilt), 0, -np.cos(tilt)])
    speed = np.sqrt(GRAVITY * length * np.sin(tilt) * np.tan(tilt))
    found = swing(Payload(1.0, length), r, np.array([0, speed, 0]), np.zeros((20000, 3)), 0.005, GRAVITY)
    tension = np.linalg.norm(found, axis=1)
    np.testing.assert_allclose(tension, GRAVITY / np.cos(tilt), rtol=1e-3)  # over 100 s: no drift


def test_the_hook_of_a_turning_body_accelerates_towards_the_axis_and_along_the_turn():
    x = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0, 0, 0, 0, 0, 2.0])
    a = hook_acceleration((0.1, 0, 0), x, np.array([0, 0, 1.0]), np.array([0, 0, 5.0]))
    np.testing.assert_allclose(a, [-0.4, 0.5, 1.0], atol=1e-12)


def test_a_payload_at_rest_pulls_with_its_weight_at_its_hook():
    dut = SuspendedPayload(0.5, 1.0, 0.1, 0.0, -0.05)
    x = np.tile([0, 0, 1.0, 1.0, *np.zeros(9)], (20, 1))
    still = {"a": np.zeros((20, 3)), "al": np.zeros((20, 3)), "r_rate": np.zeros(3)}
    chi = dut.wrench_along(Vehicle(), x=x, step=0.01, r=np.array([0, 0, -1.0]), **still)
    np.testing.assert_allclose(chi, np.tile([0, 0, -0.5 * GRAVITY, 0, 0.05 * GRAVITY, 0], (20, 1)), atol=1e-9)


def test_a_payload_has_no_momentary_wrench(motion):
    with pytest.raises(NotImplementedError, match="wrench_along"):
        SuspendedPayload().wrench(Vehicle(), motion)


def test_it_is_compiled_where_no_folder_takes_what_was_compiled(monkeypatch):
    def read_only(**how):
        if how.get("cache"):
            raise RuntimeError("cannot cache function: no locator available")
        return njit(**how)

    monkeypatch.setattr(pendulum, "njit", read_only)
    assert pendulum._compiled(lambda x: 2 * x)(21) == 42
