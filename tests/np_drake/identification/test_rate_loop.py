"""Laws of the identification of a rate loop."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.identification.rate_loop import identify_rate_loop

STEP, SECONDS = 0.02, 40.0


def flown(lags, gains, *, noise=0.005, seed=0, delay=0):
    """A log in which each axis follows its command as a first-order loop, a whole number of rows
    late.
    """
    rng, n = np.random.default_rng(seed), int(SECONDS / STEP)
    command = np.repeat(rng.normal(size=(n // 10 + 1, 3)), 10, axis=0)[:n]
    w = np.zeros((n, 3))
    decay = np.exp(-STEP / np.array(lags))
    for k in range(1, n):
        w[k] = decay * w[k - 1] + (1 - decay) * gains * command[max(k - 1 - delay, 0)]
    zeros = np.zeros((n, 3))
    return FlightLog(
        t=STEP * np.arange(n),
        p=zeros,
        q=np.tile([1.0, 0, 0, 0], (n, 1)),
        v=zeros,
        w=w + noise * rng.normal(size=w.shape),
        u=np.zeros((n, 4)),
        commanded_rates=command,
    )


def test_lag_and_gain_of_each_axis_are_found_within_their_intervals():
    lags, gains = [0.05, 0.08, 0.2], np.array([1.0, 0.9, 1.2])
    for loop, lag, gain in zip(identify_rate_loop([flown(lags, gains)]), lags, gains, strict=True):
        assert loop.lag == pytest.approx(lag, rel=0.03)
        assert loop.gain == pytest.approx(gain, rel=0.02)
        assert loop.lag_interval[0] < loop.lag < loop.lag_interval[1] < 1.2 * loop.lag
        assert loop.share > 0.99


def test_a_delay_is_part_of_the_lag():
    late = identify_rate_loop([flown([0.05] * 3, np.ones(3), delay=1)])
    assert [loop.lag for loop in late] == pytest.approx([0.05 + STEP] * 3, rel=0.05)


def test_rates_that_do_not_follow_show_no_loop():
    log = flown([0.05] * 3, np.ones(3))
    rng = np.random.default_rng(1)
    assert identify_rate_loop([dc.replace(log, w=rng.normal(size=log.w.shape))]) is None
