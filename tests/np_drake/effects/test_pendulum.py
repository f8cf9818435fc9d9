import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from np_drake.effects.pendulum import (
    Payload,
    hanging,
    hook_acceleration,
    hook_velocity,
    swing,
    swing_many,
    tether_force,
)
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

GRAVITY = 9.81
WEIGHT = np.array([0, 0, GRAVITY])


def spherical(length, r, r_rate, hook, t, damping=0.0):
    """Return the specific pull (len(t), 3) of a taut pendulum by a general integrator."""

    def pushed(t):
        return WEIGHT + hook(t) + damping * hook_speed(t)

    def pull(t, s):
        r, v = s[:3], s[3:]
        return r / length**2 * (v @ v - r @ pushed(t))

    def rate(t, s):
        return np.concatenate([s[3:], -pull(t, s) - pushed(t) - damping * s[3:]])

    s = solve_ivp(
        rate, (0, t[-1]), np.concatenate([r, r_rate]), t_eval=t, rtol=1e-11, atol=1e-12
    ).y.T
    return np.stack([pull(ti, si) for ti, si in zip(t, s, strict=True)])


def hook(t):
    return np.array([2 * np.sin(3 * t), 1.5 * np.cos(2 * t), np.sin(5 * t)])


def hook_speed(t):
    """Return the velocity of `hook` (3,), 0.5 m/s along x at first."""
    return np.array(
        [0.5 + 2 / 3 * (1 - np.cos(3 * t)), 0.75 * np.sin(2 * t), 0.2 * (1 - np.cos(5 * t))]
    )


@pytest.mark.parametrize("damping", [0.0, 0.8])
def test_under_a_moving_hook_the_error_falls_with_the_square_of_the_step(damping):
    length, r, r_rate = 0.7, 0.7 * np.array([0.6, 0, -0.8]), np.array([0.4, 1.0, 0.3])
    errors = []
    for step in (0.01, 0.005, 0.0025):
        t = step * (np.arange(round(2 / step)) + 0.5)
        a = np.stack([hook(ti) for ti in t])
        how = {"damping": damping, "v_hook": np.stack([hook_speed(ti) for ti in t])}
        found = swing_many(np.array([length]), r[None], r_rate[None], a, step, GRAVITY, **how)[:, 0]
        errors.append(np.abs(found - spherical(length, r, r_rate, hook, t, damping)).max())
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
    damping, v = np.linspace(0, 0.5, 5), np.cumsum(0.004 * a, axis=0)
    found = swing_many(lengths, r, r_rate, a, 0.004, GRAVITY, damping=damping, v_hook=v)
    for i in range(5):
        payload = Payload(2.0, lengths[i], damping=damping[i])
        alone = swing(payload, r[i], r_rate[i], a, 0.004, GRAVITY, v)
        np.testing.assert_allclose(alone, 2.0 * found[:, i], rtol=1e-9, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_a_tether_only_pulls_and_is_never_longer_than_it_is(seed):
    lengths, r, r_rate, a = some_pendulums(seed)
    step = 0.004
    pull = swing_many(lengths, r, r_rate, a, step, GRAVITY)
    r, v = r + 0.5 * step * r_rate, r_rate  # what the payloads do under these pulls
    r = r / np.maximum(np.linalg.norm(r, axis=1) / lengths, 1.0)[:, None]
    for p, a_hook in zip(pull, a, strict=True):
        assert (np.sum(p * r, axis=1) >= -1e-9).all()
        np.testing.assert_allclose(np.cross(p, r), 0.0, atol=1e-6)
        v = v - step * (p + a_hook + WEIGHT)
        r = r + step * v
        assert (np.linalg.norm(r, axis=1) <= lengths * (1 + 1e-9)).all()


def test_in_steady_flight_the_payload_hangs_back_by_drag_over_weight():
    payload, v = Payload(0.1, 0.6, damping=0.5), np.array([3.0, 0.0, 0.0])
    lag = np.arctan(payload.damping * v[0] / GRAVITY)
    start = (0.6 * np.array([-np.sin(lag), 0.0, -np.cos(lag)]), np.zeros(3))
    steady = {
        "a_hook": np.zeros((2000, 3)),
        "step": 0.005,
        "gravity": GRAVITY,
        "v_hook": np.tile(v, (2000, 1)),
    }
    expected = payload.mass * np.array([-payload.damping * v[0], 0.0, -GRAVITY])  # drag and weight
    np.testing.assert_allclose(
        swing(payload, *start, **steady), np.tile(expected, (2000, 1)), atol=1e-9
    )
    np.testing.assert_allclose(
        tether_force(payload, *start, np.zeros(3), GRAVITY, v), expected, atol=1e-12
    )


def test_a_hanging_tether_leans_as_asked_and_never_is_level():
    r, rate = hanging(np.array([[0.2, 0.1], [-3.0, 4.0]]), np.array([[0.3, -0.5], [0.0, 1.0]]), 0.5)
    np.testing.assert_allclose(r[0], [0.2, 0.1, -np.sqrt(0.25 - 0.05)])
    np.testing.assert_allclose(r[1, :2], 0.99 * 0.5 * np.array([-0.6, 0.8]))
    np.testing.assert_allclose(rate[:, :2], [[0.3, -0.5], [0.0, 1.0]])
    assert (r[:, 2] < 0).all()


def test_a_slack_tether_is_silent_until_it_snaps_and_then_stops_the_fall():
    drop, step = 0.3, 0.001  # hangs 0.5 m below a hook of 0.8 m
    found = swing(
        Payload(1.0, 0.8), np.array([0, 0, -0.5]), np.zeros(3), np.zeros((1000, 3)), step, GRAVITY
    )
    snap = np.sqrt(2 * drop / GRAVITY)
    pulled = np.flatnonzero(found[:, 2])
    assert pulled[0] * step == pytest.approx(snap, abs=2 * step)
    np.testing.assert_array_equal(found[: pulled[0]], 0.0)
    impulse = -found[pulled[0] : pulled[0] + 3, 2].sum() * step
    assert impulse == pytest.approx(GRAVITY * snap, abs=3 * GRAVITY * step)  # [m/s]: inelastic
    np.testing.assert_allclose(found[pulled[0] + 3 :, 2], -GRAVITY, rtol=1e-9)  # then it hangs


def test_a_tether_never_pushes():
    f = tether_force(Payload(), np.array([0, 0, 0.8]), np.zeros(3), np.zeros(3), GRAVITY)
    np.testing.assert_array_equal(f, 0.0)


def test_a_turning_hook_moves_across_its_arm_and_accelerates_to_the_axis():
    x = np.array([0, 0, 1.0, 1.0, 0, 0, 0, 0.5, 0, 0, 0, 0, 2.0])
    np.testing.assert_allclose(hook_velocity((0.1, 0, 0), x), [0.5, 0.2, 0.0], atol=1e-12)
    a = hook_acceleration((0.1, 0, 0), x, np.array([0, 0, 1.0]), np.array([0, 0, 5.0]))
    np.testing.assert_allclose(a, [-0.4, 0.5, 1.0], atol=1e-12)


def test_a_payload_at_rest_pulls_with_its_weight_at_its_hook():
    dut = SuspendedPayload(0.5, 1.0, 0.1, 0.0, -0.05, 0.3)
    x = np.tile([0, 0, 1.0, 1.0, *np.zeros(9)], (20, 1))
    still = {"a": np.zeros((20, 3)), "al": np.zeros((20, 3)), "r_rate": np.zeros(3)}
    chi = dut.wrench_along(Vehicle(), x=x, step=0.01, r=np.array([0, 0, -1.0]), **still)
    np.testing.assert_allclose(
        chi, np.tile([0, 0, -0.5 * GRAVITY, 0, 0.05 * GRAVITY, 0], (20, 1)), atol=1e-9
    )


def test_a_payload_has_no_momentary_wrench(motion):
    with pytest.raises(NotImplementedError, match="wrench_along"):
        SuspendedPayload().wrench(Vehicle(), motion)
