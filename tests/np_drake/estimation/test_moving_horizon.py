"""Laws of the moving-horizon estimator, in closed form and on MathematicalProgram."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.estimation.mhe_config import MheConfig
from np_drake.estimation.moving_horizon import LeastSquaresWindow, MovingHorizonEstimator
from np_drake.estimation.moving_horizon_program import ProgramWindow

STEP = 0.0025
SOLVERS = {"least squares": LeastSquaresWindow, "program": ProgramWindow}
D = np.array([1.0, -2.0, 12.0, 30.0, -10.0, 4.0])  # [m/s², rad/s²]


def config(**changes) -> MheConfig:
    """Weights that differ in every channel."""
    spread = np.array([1.0, 1.3, 0.7, 2.0, 0.5, 1.1])
    start = MheConfig()
    uneven = {
        name: (spread * getattr(start, name)).tolist()
        for name in ("arrival_motion", "arrival_acceleration", "measurement", "process")
    }
    return dc.replace(start, **{**uneven, **changes})


def flight(n, seed=0, noise=0.0, d=D):
    """Samples and known inputs of a motion under the acceleration d (6,) or (n, 6)."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(n, 6))
    d = np.broadcast_to(d, (n, 6))
    y = np.concatenate([np.zeros((1, 6)), STEP * np.cumsum((d + u)[:-1], axis=0)])
    return y + noise * rng.normal(size=(n, 6)), u


def run(dut, y, u, d0):
    """All estimates of a stretch, from y[0] and d0 on."""
    memory, out = dut.initial_memory(y[0], d0), []
    for sample, known in zip(y, u, strict=True):
        memory, estimate = dut.update(memory, sample, known)
        out.append(estimate)
    return out


def make(name="least squares", settings=None):
    settings = settings or config()
    return MovingHorizonEstimator(settings, STEP, SOLVERS[name](settings, STEP))


@pytest.mark.parametrize("name", SOLVERS)
def test_a_constant_wrench_is_recovered_exactly_from_samples_without_noise(name):
    y, u = flight(40)
    for estimate in run(make(name), y, u, D):
        np.testing.assert_allclose(estimate.acceleration, D, atol=1e-7)
        assert not estimate.held


def test_a_wrong_first_guess_is_forgotten():
    y, u = flight(1500)
    error = [np.abs(estimate.acceleration - D).max() for estimate in run(make(), y, u, np.zeros(6))]
    assert error[0] > 10.0
    assert error[-1] < 1e-6


def kalman_smoother(settings, y, u, d0):
    """(n, 2, 6) by the textbook: Kalman filter forth, Rauch-Tung-Striebel back, one channel at a
    time.
    """
    F, G, noise = np.array([[1, STEP], [0, 1]]), np.array([STEP, 0]), np.array([STEP**2 / 2, STEP])
    out = np.empty((len(y), 2, 6))
    for c in range(6):
        m = np.array([y[0, c], d0[c]])
        P = np.diag([1 / settings.arrival_motion[c], 1 / settings.arrival_acceleration[c]])
        Q, R = np.outer(noise, noise) / settings.process[c], 1 / settings.measurement[c]
        filtered, predicted = [], []
        for k in range(len(y)):
            if k:
                m, P = F @ m + G * u[k - 1, c], F @ P @ F.T + Q
            predicted.append((m, P))
            gain = P[:, 0] / (P[0, 0] + R)
            m, P = m + gain * (y[k, c] - m[0]), P - np.outer(gain, P[0])
            filtered.append((m, P))
        out[-1, :, c] = m
        for k in range(len(y) - 2, -1, -1):
            back = filtered[k][1] @ F.T @ np.linalg.inv(predicted[k + 1][1])
            out[k, :, c] = filtered[k][0] + back @ (out[k + 1, :, c] - predicted[k + 1][0])
    return out


@pytest.mark.parametrize("name", SOLVERS)
def test_a_growing_window_is_the_kalman_smoother(name):
    settings = config(horizon=12)
    y, u = flight(13, noise=0.01)
    for k, estimate in enumerate(run(make(name, settings), y, u, 0.5 * D)):
        reference = kalman_smoother(settings, y[: k + 1], u, 0.5 * D)
        np.testing.assert_allclose(estimate.x, reference, rtol=1e-6, atol=1e-6)


def batch_least_squares(settings, arrival, y, u):
    """(n + 1, 2, 6): the cost as one writes it, its residuals found by running the model."""
    n = len(u)
    out = np.empty((n + 1, 2, 6))
    for c in range(6):

        def simulate(unknown, known):
            x = [unknown[:2]]
            for k in range(n):
                (motion, d), w = x[-1], unknown[2 + k]
                x.append([motion + STEP * (d + known[k]) + STEP**2 / 2 * w, d + STEP * w])
            return np.array(x)

        def residuals(unknown, known, target, anchor, channel=c):
            age = np.arange(n, -1, -1.0)
            R = settings.measurement[channel] * settings.forgetting_measurement**age
            Q = settings.process[channel] * settings.forgetting_process ** age[1:]
            P = [settings.arrival_motion[channel], settings.arrival_acceleration[channel]]
            path = simulate(unknown, known)
            return np.sqrt([*P, *R, *Q]) * [
                *(path[0] - anchor),
                *(path[:, 0] - target),
                *unknown[2:],
            ]

        zero = residuals(np.zeros(2 + n), u[:, c], y[:, c], arrival[:, c])
        J = np.stack(
            [residuals(e, u[:, c], y[:, c], arrival[:, c]) - zero for e in np.eye(2 + n)], axis=1
        )
        scale = np.linalg.norm(J, axis=0)
        out[:, :, c] = simulate(-np.linalg.lstsq(J / scale, zero)[0] / scale, u[:, c])
    return out


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("factors", [(1.0, 1.0), (0.6, 0.3)])
def test_the_window_minimises_the_cost_with_forgetting(name, factors):
    settings = config(forgetting_measurement=factors[0], forgetting_process=factors[1])
    y, u = flight(11, seed=3, noise=0.01)
    arrival = np.stack([y[0] + 0.02, 0.3 * D])
    x = SOLVERS[name](settings, STEP).solve(arrival, y, u[:-1])
    np.testing.assert_allclose(
        x, batch_least_squares(settings, arrival, y, u[:-1]), rtol=1e-5, atol=1e-5
    )


def test_the_arrival_is_what_the_last_window_said_of_the_first_sample():
    settings = config(horizon=5)
    dut, exact = make(settings=settings), LeastSquaresWindow(settings, STEP)
    y, u = flight(30, noise=0.01)
    estimates = run(dut, y, u, D)
    for k in (6, 17, 29):
        expected = exact.solve(estimates[k - 1].x[1], y[k - 5 : k + 1], u[k - 5 : k])
        np.testing.assert_allclose(estimates[k].x, expected, atol=1e-12)


def test_no_window_is_longer_than_the_horizon():
    y, u = flight(30)
    lengths = [len(estimate.x) for estimate in run(make(settings=config(horizon=4)), y, u, D)]
    assert lengths == [1, 2, 3, 4, *[5] * 26]


def test_forgetting_old_noise_follows_a_jump_sooner():
    d = np.where(np.arange(60)[:, None] < 30, D, 3 * D)
    y, u = flight(60, d=d)
    slow, fast = (
        run(make(settings=config(forgetting_process=g)), y, u, D)[34].acceleration
        for g in (1.0, 0.3)
    )
    assert np.all(np.abs(fast - 3 * D) < np.abs(slow - 3 * D))


def test_the_program_and_the_closed_form_agree_over_a_flight_with_gaps():
    y, u = flight(80, noise=0.01)
    y[20:23], y[40, 2], u[50, 4], y[60:75, 3:] = np.nan, np.nan, np.nan, np.nan
    settings = config(forgetting_measurement=0.9, forgetting_process=0.7)
    exact, program = (run(make(name, settings), y, u, D) for name in ("least squares", "program"))
    for a, b in zip(exact, program, strict=True):
        assert not b.held
        np.testing.assert_allclose(a.x, b.x, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("name", SOLVERS)
def test_without_samples_the_wrench_is_held_and_the_motion_foretold(name):
    y, u = flight(60)
    truth = y.copy()
    y[30:] = np.nan
    last = run(make(name), y, u, D)[-1]
    np.testing.assert_allclose(last.acceleration, D, atol=1e-6)
    np.testing.assert_allclose(last.x[-1, 0], truth[-1], atol=1e-7)


def test_a_missing_channel_leaves_the_others_as_they_are():
    y, u = flight(40, noise=0.01)
    gap = y.copy()
    gap[20:30, 1] = np.nan
    whole, with_gap = run(make(), y, u, D)[-1], run(make(), gap, u, D)[-1]
    others = [0, 2, 3, 4, 5]
    np.testing.assert_array_equal(whole.x[..., others], with_gap.x[..., others])
    assert np.abs(whole.acceleration - with_gap.acceleration)[1] > 1e-6
    assert np.isfinite(with_gap.x).all()


def test_a_missing_input_stands_for_the_one_before():
    y, u = flight(40, noise=0.01)
    held, gap = u.copy(), u.copy()
    held[20], gap[20] = u[19], np.nan
    np.testing.assert_array_equal(run(make(), y, held, D)[-1].x, run(make(), y, gap, D)[-1].x)


class Failing:
    """Fails at chosen calls, in one of two ways."""

    def __init__(self, calls, answer):
        self._exact, self._calls, self._answer, self.call = (
            LeastSquaresWindow(config(), STEP),
            calls,
            answer,
            -1,
        )

    def solve(self, arrival, y, u):
        self.call += 1
        x = self._exact.solve(arrival, y, u)
        return (
            x
            if self.call not in self._calls
            else None
            if self._answer is None
            else x * self._answer
        )


@pytest.mark.parametrize("answer", [None, np.nan])
@pytest.mark.parametrize("calls", [{0}, {3}, {25, 26}])
def test_a_failed_solve_says_so_holds_the_wrench_and_is_recovered_from(calls, answer):
    y, u = flight(40)
    estimates = run(MovingHorizonEstimator(config(), STEP, Failing(calls, answer)), y, u, D)
    for k, estimate in enumerate(estimates):
        assert estimate.held == (k in calls)
        np.testing.assert_allclose(estimate.acceleration, D, atol=1e-7)
        np.testing.assert_allclose(estimate.x[-1, 0], y[k], atol=1e-9)


def test_a_program_that_cannot_be_solved_has_no_answer():
    y, u = flight(11)
    y[4, 0] = 1e300
    assert ProgramWindow(config(), STEP).solve(np.stack([y[0], D]), y, u[:-1]) is None


def test_two_memories_of_one_estimator_never_meet():
    dut, (y, u) = make(), flight(30, noise=0.01)
    alone = run(dut, y, u, D)
    one, other = dut.initial_memory(y[0], D), dut.initial_memory(y[0], -D)
    for k in range(30):
        one, estimate = dut.update(one, y[k], u[k])
        other, _ = dut.update(other, -y[k], u[k])
        np.testing.assert_array_equal(estimate.x, alone[k].x)


@pytest.mark.parametrize(
    "changes",
    [
        {"horizon": 0},
        {"process": [1.0] * 5},
        {"measurement": [1.0] * 5 + [0.0]},
        {"arrival_motion": [1.0] * 5 + [np.nan]},
        {"forgetting_process": 0.0},
        {"forgetting_measurement": 1.1},
    ],
)
def test_an_impossible_configuration_is_refused(changes):
    with pytest.raises(ValueError, match=next(iter(changes))):
        config(**changes).check()


def test_an_impossible_step_is_refused():
    with pytest.raises(ValueError, match="step must be positive"):
        MovingHorizonEstimator(config(), 0.0)
