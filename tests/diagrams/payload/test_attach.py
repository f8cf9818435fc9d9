"""Laws of the payload that changes in flight."""

import itertools

import numpy as np
import pytest
from scipy import signal

from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.flight_result import fly
from diagrams.payload import attach, attach_study
from diagrams.payload.figures import event_responses
from np_drake.lifting.model.encoders import DelayEncoder
from np_drake.lifting.model.lifted_linear_system import LiftedLinearSystem
from np_drake.lifting.model.lifted_model import DELAY_DMDC, LiftedModel

T = 0.02 * np.arange(-200, 200)  # since the event [s]


@pytest.fixture(scope="module")
def config():
    return attach.attach_config(attach.ROWS[0], solver="sqp", model=str(NP_MODEL))


def lag(tau, size, *, scale=1.0):
    """(n,) a first-order answer to a step."""
    return np.where(T >= 0, size * (1 - np.exp(-T / tau)), 0.0) * scale


def test_the_label_sees_the_weight_over_the_thrust_scale(config):
    assert attach.expected_step("attach", config) == pytest.approx(-0.981 / 0.96)  # [N]
    assert attach.expected_step("release", config) == pytest.approx(0.26 * 9.81 / 0.96)
    assert attach.expected_step("snap", config) == 0.0


def test_a_first_order_lag_reaches_90_percent_in_ln_10_time_constants():
    step = attach.step_response(T, np.array([lag(0.1, -2.0), lag(0.1, -2.2)]))
    assert step.size == pytest.approx(-2.1, abs=1e-6)  # [N]
    assert step.rise == pytest.approx(0.1 * np.log(10), abs=2e-3)  # [s]; a line between samples
    assert step.overshoot == pytest.approx(0.0, abs=1e-6)
    assert step.dip == pytest.approx(0.1, abs=0.03)  # of the step: the first sample past 90 %
    assert step.scatter == pytest.approx(0.2 / np.sqrt(2))


def test_overshoot_is_counted_in_the_direction_of_the_step():
    bump = np.where((T > 0.5) & (T < 0.6), 0.3, 0.0)
    for sign in (1.0, -1.0):
        course = sign * (lag(0.05, 2.0) + bump)
        step = attach.step_response(T, np.array([course, course]))
        assert step.overshoot == pytest.approx(0.15, abs=1e-3)  # 0.3 of 2 N


def test_a_signal_that_never_arrives_has_no_rise_time():
    late = np.where(T >= attach.AFTER, 1.0, 0.0)
    assert attach.step_response(T, np.array([late, late])).rise == np.inf


def test_the_labels_deviation_is_the_filtered_noise_of_the_accelerometer(config):
    raw = config.vehicle.mass * 0.1 * np.random.default_rng(0).normal(size=200_000)
    filtered = signal.sosfilt(config.controller.label.filters(config.controller.period)[0][1], raw)
    assert attach_study.label_deviation(config) == pytest.approx(filtered.std(), rel=0.01)  # [N]


def test_a_payload_tossed_up_is_slack_until_it_has_fallen_back():
    snap = attach.attach_config(attach.ROWS[0], solver="sqp", model=str(NP_MODEL), event="snap")
    snap.reference.ramp, snap.duration, snap.events[0].time = 0.4, 0.8, 0.6
    flight = fly(snap, seed=1)
    assert attach.slack_time(flight) == pytest.approx(
        2 * (0.3 / 0.26) / 9.81, abs=0.08
    )  # [s]; the hook sinks


def test_an_encoder_that_averages_its_window_shows_a_step_in_proportion():
    E = np.zeros((6, 12 * 10)).reshape(6, 10, 12)
    E[np.arange(6), :, np.arange(6)] = 0.1
    system = LiftedLinearSystem(np.eye(6), np.zeros((6, 6)), np.eye(6), 0.02)
    encoder = DelayEncoder(E.reshape(6, -1), 10, offset=np.ones(6))
    model = LiftedModel(DELAY_DMDC, system, encoder, 10, np.ones(6), np.ones(6), False)
    np.testing.assert_allclose(
        attach_study.encoder_step(model), np.linspace(0.0, 1.0, 11), atol=1e-12
    )


def made_runs():
    rng, runs = np.random.default_rng(0), []
    for event, row, seed in itertools.product(attach.EVENTS, attach.ROWS, range(3)):
        f = lag(0.05, -1.0) + 0.01 * rng.normal(size=len(T))
        runs.append(
            {
                "event": event,
                "row": row.name,
                "seed": seed,
                "t": T,
                "slack": 0.24,
                "chi_hat": f,
                "label": f,
            }
        )
        runs[-1] |= {"height": 0.01 * np.sin(T), "solve_failures": 0, "fallbacks": 0}
    return runs


def test_the_table_has_a_line_for_every_event_controller_and_signal(config):
    lines = attach.attach_table(made_runs(), config)
    assert [(line["event"], line["row"], line["signal"]) for line in lines] == [
        (e, row.name, s) for e in attach.EVENTS for row in attach.ROWS for s in attach.SIGNALS
    ]
    assert lines[0]["error"] == pytest.approx(-1.0 / (-0.981 / 0.96) - 1, abs=5e-3)
    assert "size" not in lines[-1]
    assert lines[-1]["slack"] == pytest.approx(0.24)


def test_the_figure_has_a_panel_for_every_event(config):
    figure = event_responses(made_runs(), config, "three flights")
    assert len(figure.axes) == len(attach.EVENTS)
    assert all("N" in ax.get_ylabel() for ax in figure.axes)
