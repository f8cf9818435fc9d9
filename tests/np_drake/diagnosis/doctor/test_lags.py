"""Laws of lags: what is shifted is found by as much, with an interval that holds it."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.doctor.flight_facts import lags


def late(log, field, seconds):
    """Return the log with one signal logged late [s]."""
    values = getattr(log, field)
    if field == "q":
        values = attitude.one_hemisphere(values, values[0])
    moved = np.stack([np.interp(log.t - seconds, log.t, c) for c in values.T], axis=1)
    return dc.replace(
        log,
        **{field: moved / np.linalg.norm(moved, axis=1, keepdims=True) if field == "q" else moved},
    )


def of(log):
    return {(lag.late, lag.early): lag for lag in lags(log)}


@pytest.mark.parametrize("seconds", [0.0, 0.008, 0.03])
@pytest.mark.parametrize(
    "field, pair, sign",
    [
        ("q", ("attitude", "body rates"), 1),
        ("p", ("position", "velocity"), 1),
        ("a", ("velocity", "acceleration"), -1),
        ("u", ("lift", "thrust"), -1),
        ("u", ("turning", "torque"), -1),
    ],
)
def test_a_late_signal_is_found_late(fly, field, pair, sign, seconds):
    log = fly(seed=1, noise=0.3)
    dut = of(late(log, field, seconds))[pair]
    assert dut.seconds == pytest.approx(
        sign * seconds, abs=max(4 * dut.deviation, 0.0015)
    )  # parabola of a 5 ms grid
    assert dut.deviation < 0.01


def test_hover_tells_no_lag_of_the_attitude(fly):
    assert ("attitude", "body rates") not in of(fly(vigour=0.0, noise=1.0, attitude_noise=0.002))


def test_signals_that_hardly_correlate_tell_no_lag(fly):
    log = fly(seed=1)
    assert ("attitude", "body rates") in of(log)
    noisy = log.w + np.random.default_rng(0).normal(size=log.w.shape)  # rad/s
    assert ("attitude", "body rates") not in of(dc.replace(log, w=noisy))
