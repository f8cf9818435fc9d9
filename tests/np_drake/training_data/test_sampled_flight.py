import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig, labels
from np_drake.training_data.training_segments import sampled_flight
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
RATE = np.array([1.0, -2.0, 3.0])  # N/s


def ramp(step=0.002, seconds=1.0):
    """A level vehicle that is pushed by a force which grows with time."""
    t = step * np.arange(round(seconds / step) + 1) + 7.0
    force = RATE * (t - 7.0)[:, None]
    n, zero = len(t), np.zeros((len(t), 3))
    q, u = np.tile([1.0, 0, 0, 0], (n, 1)), np.tile(VEHICLE.hover_input, (n, 1))
    v = np.stack([t - 7.0, 0 * t, 0 * t], axis=1)
    return FlightLog(t, zero, q, v, zero, u, force / VEHICLE.mass, zero)


def test_a_label_is_the_mean_over_the_step_that_ends_at_its_sample():
    flight = sampled_flight(ramp(), VEHICLE, step=0.02)
    k = np.arange(1, len(flight))
    # Ten rows of a step, from 18 ms before its end to the end: 9 ms before the sample in the mean.
    np.testing.assert_allclose(flight.chi[1:, :3], np.outer(0.02 * k - 0.009, RATE), atol=1e-9)
    np.testing.assert_allclose(flight.x[:, 7], 0.02 * np.arange(len(flight)), atol=1e-9)
    assert len(flight) == 51
    assert flight.gapless


def test_a_sample_uses_nothing_later():
    log = ramp()
    k = 20
    now = round(k * 0.02 / 0.002)
    later = dc.replace(log, a=log.a.copy(), v=log.v.copy(), u=log.u.copy())
    later.a[now + 1 :], later.v[now + 1 :], later.u[now + 1 :] = 9.0, 9.0, 9.0
    one, other = (sampled_flight(flown, VEHICLE, step=0.02).sample(k) for flown in (log, later))
    for name in ("x", "u", "chi"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_gap_has_no_label_keeps_the_command_and_is_bridged_for_training():
    log = ramp()
    gone = (log.t > 7.4 + 1e-6) & (log.t < 7.44 + 1e-6)
    cut = dc.replace(
        log, **{n: getattr(log, n)[~gone] for n in ("t", "p", "q", "v", "w", "u", "a", "al")}
    )
    flight = sampled_flight(cut, VEHICLE, step=0.02)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(flight.chi).any(axis=1)), [21, 22])
    assert not flight.gapless
    np.testing.assert_array_equal(flight.u[[21, 22]], flight.u[[20, 20]])
    np.testing.assert_allclose(flight.x[[21, 22], 7], 0.4, atol=1e-9)
    whole = sampled_flight(log, VEHICLE, step=0.02)
    np.testing.assert_allclose(flight.segment.chi, whole.segment.chi, atol=1e-9)


def test_labels_of_another_low_pass_are_those_of_the_flight():
    log, config = ramp(), LabelConfig(2.0, 2.0)
    flight = sampled_flight(log, VEHICLE, step=0.02, label=config)
    np.testing.assert_array_equal(flight.chi, labels(log, VEHICLE, config)[::10])


def test_a_step_below_that_of_the_log_is_refused():
    with pytest.raises(ValueError, match="step must be at least"):
        sampled_flight(ramp(), VEHICLE, step=0.001)
    with pytest.raises(ValueError, match="must last two steps"):
        sampled_flight(ramp(seconds=0.03), VEHICLE, step=0.02)
