"""Laws of the predictor that carries a bank of pendulums."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from np_drake import attitude
from np_drake.command_delay import KEPT
from np_drake.mpc.look_ahead import LookAhead
from np_drake.payload_filter import kernel
from np_drake.payload_filter.filter_bank import carries
from np_drake.payload_filter.forecast import linear_pendulum
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Plan, Sample
from np_drake.vehicle import Vehicle
from tests.np_drake.payload_filter.conftest import flown, model

G, MASS, STEP = 9.81, 2.0, 0.02  # of the made-up flights: gravity [m/s²], vehicle [kg], sample [s]
HOOK = np.array([0.0, 0.0, -0.025])  # [m]
SPAN = {"horizon": 20, "stride": 2}


def run(predictor, samples, memory=None):
    memory = predictor.initial_memory() if memory is None else memory
    for sample in samples:
        memory = predictor.update(memory, sample)
    return memory


def plan_from(flight, k, horizon=20, stride=2):
    rows = k + stride * np.arange(horizon + 1)
    return Plan(flight.x[rows], flight.u[rows[:-1]])


def mean_force(flight, k, horizon=20, stride=2):
    """Mean true pull over each step of a forecast from sample k [N]."""
    ends = 0.5 * (flight.pull[1:] + flight.pull[:-1])
    return ends[k : k + horizon * stride].reshape(horizon, stride, 3).mean(axis=1)


def test_a_hanging_payload_pulls_with_its_weight_over_the_horizon():
    predictor = PayloadFilter(model())
    forecast = predictor.forecast(run(predictor, flown(seconds=4.0).samples), **SPAN)
    force = forecast.rollout(np.zeros((20, 6)))[:, :3]
    expected = np.tile([0.0, 0.0, -0.26 * G], (20, 1))
    np.testing.assert_allclose(force, expected, atol=0.06)  # label noise [N]


def test_a_bare_vehicle_is_believed_bare_however_long_it_flies():
    predictor = PayloadFilter(model())
    bare = ~carries(len(predictor.bank.lengths), predictor.bank.options.conditions)
    flight = flown(mass=0.0, seconds=12.0, radius=1.25, speed=2.5, noise=0.1)
    memory = run(predictor, flight.samples[:150])
    for sample in flight.samples[150:]:
        memory = predictor.update(memory, sample)
        assert memory["weight"][bare].sum() > 0.9
        # Share of the vehicle's mass [1]
        assert memory["weight"] @ memory["mean"][:, kernel.MASS] < 0.002
    assert np.linalg.norm(predictor.pull(memory)) < 0.02 * MASS * G  # thrust error's prior [N]


@pytest.mark.parametrize(("before", "after"), [(0.0, 0.1), (0.26, 0.36), (0.26, 0.0)])
def test_a_payload_attached_or_lost_is_followed_within_300_ms(before, after):
    n, change = 301, 200
    masses = np.where(np.arange(n) < change, before, after)
    flight = flown(mass=masses, seconds=(n - 1) * STEP)
    predictor = PayloadFilter(model())
    memory = run(predictor, flight.samples[: change + round(0.3 / STEP)])
    force = predictor.forecast(memory, **SPAN).rollout(np.zeros((20, 6)))[:, 2]
    # a tenth of the step
    np.testing.assert_allclose(force, -after * G, atol=0.1 * abs(after - before) * G + 0.05)


@pytest.mark.parametrize("length", [0.4, 1.6])
def test_a_swing_is_foretold_over_the_whole_horizon(length):
    flight = flown(length=length, seconds=12.0, radius=1.0, swing=0.2)
    predictor, k = PayloadFilter(model()), 500
    memory = run(predictor, flight.samples[: k + 1])
    plan = plan_from(flight, k)
    force = predictor.forecast_along(memory, plan, **SPAN).rollout(plan.x[:-1, 7:13])[:, :3]
    drag = 0.125 * MASS * 0.5 * (plan.x[1:, 7:10] + plan.x[:-1, 7:10])
    error = np.linalg.norm(force + drag - mean_force(flight, k), axis=1)
    held = np.linalg.norm(flight.pull[k] - mean_force(flight, k), axis=1)
    assert error.max() < 0.15 * held.max(), (error.max(), held.max())


def test_a_hook_elsewhere_than_in_training_is_found_in_flight():
    flight = flown(length=0.8, seconds=12.0, radius=1.0, swing=0.2)
    predictor, k = PayloadFilter(model(hook=HOOK + [0.01, 0.0, 0.02])), 500
    memory = run(predictor, flight.samples[: k + 1])
    # three tenths of the prior [m]
    np.testing.assert_allclose(memory["shift"], [-0.01, 0.0, -0.02], atol=0.006)
    plan = plan_from(flight, k)
    tau = predictor.forecast_along(memory, plan, **SPAN).rollout(plan.x[:-1, 7:13])[:, 3:]
    pull_B = attitude.rotate_back(plan.x[:-1, 3:7], mean_force(flight, k))
    clean = np.cross(HOOK, pull_B)
    # noise of the label [N·m]
    assert np.abs(tau - clean).max() < 0.35 * np.abs(clean).max() + 0.006


def test_after_a_swing_length_and_mass_are_those_that_fly():
    flight = flown(length=1.2, seconds=10.0, radius=1.0, swing=0.3, noise=0.02)
    memory = run(PayloadFilter(model()), flight.samples)
    mass, log_length = memory["weight"] @ memory["mean"][:, [kernel.MASS, kernel.LOG_LENGTH]]
    assert np.exp(log_length) == pytest.approx(1.2, rel=0.05)
    assert mass == pytest.approx(0.26 / MASS, rel=0.05)


def test_a_look_ahead_takes_the_memory_along():
    dut, vehicle = PayloadFilter(model()), Vehicle()
    x, sent = np.zeros(13), np.tile(vehicle.hover_input, (KEPT, 1))
    x[2], x[3], x[7] = 1.0, 1.0, 0.5
    sample = Sample(x, vehicle.hover_input, np.full(6, np.nan))
    memory = dut.update(dut.initial_memory(), sample)
    later, ahead = LookAhead(dut, vehicle)(memory, x, sent, 3 * STEP)
    np.testing.assert_array_equal(later["x"], ahead)
    assert not np.array_equal(later["mean"], memory["mean"])


# stiffness [1/s²], damping [1/s], step [s]
@given(st.floats(1.0, 40.0), st.floats(0.0, 1.9), st.floats(0.005, 0.1), st.integers(0, 2**31 - 1))
@settings(max_examples=60, deadline=None)
def test_the_linear_pendulum_is_a_matrix_exponential_and_only_loses_energy(
    stiffness, damping, step, seed
):
    A, B, gain = linear_pendulum(stiffness, damping, step)
    M = np.array([[0.0, 1.0, -1.0], [-stiffness, -damping, 0.0], [0.0, 0.0, 0.0]])
    exact = expm(M * step)
    np.testing.assert_allclose(A[::2, ::2], exact[:2, :2], atol=1e-9)
    np.testing.assert_allclose(B[[0, 2], 0], exact[:2, 2], atol=1e-9)
    np.testing.assert_allclose(gain[[0, 2]], exact[:2, 2], atol=1e-9)
    assert np.abs(np.linalg.eigvals(A)).max() <= 1.0 + 1e-9
    # Work of the vehicle on the pendulum, -force · v over each step, exact under a held velocity.
    z, work = np.zeros(2), 0.0
    for v in np.random.default_rng(seed).normal(size=50):
        whole = np.linalg.solve(
            M[:2, :2], exact[:2, :2] @ z + exact[:2, 2] * v - z - step * M[:2, 2] * v
        )
        work -= stiffness * whole[0] * v
        z = exact[:2, :2] @ z + exact[:2, 2] * v
        stored = 0.5 * (z[1] ** 2 + stiffness * z[0] ** 2)
        assert work >= stored - 1e-6 * (1.0 + abs(work))


@pytest.mark.parametrize("part", ["x", "u", "chi"])
def test_a_sample_with_nan_leaves_a_usable_memory(part):
    flight, predictor = flown(seconds=6.0, radius=1.0, swing=0.2), PayloadFilter(model())
    samples = list(flight.samples[:300])
    for k in (*range(40, 44), 200, 250, 251):
        broken = getattr(samples[k], part).copy()
        broken[0] = np.nan
        samples[k] = dc.replace(samples[k], **{part: broken})
    memory = run(predictor, samples)
    assert all(np.all(np.isfinite(value)) for value in memory.values())
    whole = run(predictor, flight.samples[:300])
    # a tenth of the pull [N]
    np.testing.assert_allclose(predictor.pull(memory), predictor.pull(whole), atol=0.3)


@given(st.integers(0, 2**31 - 1), st.floats(0.01, 30.0))
@settings(max_examples=15, deadline=None)
def test_tethers_stay_unit_and_covariances_positive_for_any_labels(seed, size):
    predictor, draw = PayloadFilter(model()), np.random.default_rng(seed)
    memory = predictor.initial_memory()
    for _ in range(60):
        x = np.concatenate(
            [draw.normal(size=3), draw.normal(size=4), size * 0.1 * draw.normal(size=6)]
        )
        x[3:7] /= np.linalg.norm(x[3:7])
        memory = predictor.update(
            memory, Sample(x, size * draw.normal(size=4), size * draw.normal(size=6))
        )
    np.testing.assert_allclose(np.linalg.norm(memory["mean"][:, :3], axis=1), 1.0, atol=1e-9)
    assert np.isfinite(memory["mean"]).all()
    assert memory["weight"].sum() == pytest.approx(1.0)
    assert np.linalg.eigvalsh(memory["covariance"]).min() > -1e-6
    assert np.isfinite(predictor.forecast(memory, **SPAN).rollout(np.zeros((20, 6)))).all()


def test_a_small_swing_of_one_member_has_the_period_of_a_pendulum():
    point = np.zeros((1, kernel.POINT))
    point[0, :3], point[0, 3] = [np.sin(0.02), 0.0, -np.cos(0.02)], np.cos(0.02)
    point[0, 5] = np.sin(0.02)
    point[0, kernel.LOG_LENGTH], point[0, kernel.MASS] = np.log(0.8), 0.13
    drive = np.array([0.0, 0.0, (1 + 0.13) * G, *np.zeros(6)])
    keep, nothing = np.ones((1, 8)), np.zeros((1, kernel.SIZE))
    covariance = np.zeros((1, kernel.SIZE, kernel.SIZE))
    # lift of the whole weight holds the hook's mean at rest
    period = 2 * np.pi * np.sqrt(0.8 / (1 + 0.13) / G)
    tilt = []
    dynamics = kernel.Dynamics(STEP, np.zeros((1, 8)), keep, nothing)
    label = kernel.Label(np.full(3, np.nan), np.ones(3))
    for _ in range(round(period / STEP)):
        point = kernel.filter_bank(point, covariance, drive, drive, dynamics, label)[0]
        tilt.append(point[0, 0])
    assert (np.argmin(tilt) + 1) * STEP == pytest.approx(0.5 * period, abs=0.02)
    assert tilt[-1] == pytest.approx(np.sin(0.02), rel=0.02)
