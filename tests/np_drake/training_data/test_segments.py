"""Laws of the way from a flight to training input and to samples as a predictor sees them."""

import dataclasses as dc

import numpy as np

from np_drake import labels
from np_drake.flight_log import FlightLog
from np_drake.training_data.segments import Flight, WrenchSequence, flown_segments, sampled_flight
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
    np.testing.assert_array_equal(flight.u[[21, 22]], flight.u[[20, 20]])
    np.testing.assert_allclose(flight.x[[21, 22], 7], 0.4, atol=1e-9)
    whole = sampled_flight(log, VEHICLE, step=0.02)
    np.testing.assert_allclose(flight.segment.chi, whole.segment.chi, atol=1e-9)


def test_a_log_gives_causal_labels_and_zero_phase_targets(flight):
    (dut,) = Flight(flight, Vehicle()).segments(0.02)
    np.testing.assert_array_equal(dut.chi, labels.labels(flight, Vehicle())[::2])
    np.testing.assert_array_equal(dut.goal, labels.smooth_labels(flight, Vehicle())[::2])
    np.testing.assert_array_equal(dut.zeta, flight.x[::2, 7:13])
    assert (dut.step, dut.late) == (0.02, 2)  # 40 ms through 4 Hz


def test_a_segment_in_time_has_each_label_beside_its_own_motion(flight):
    (late,) = Flight(flight, Vehicle()).segments(0.02)
    dut = late.in_time
    np.testing.assert_array_equal(dut.chi, late.chi[2:])
    np.testing.assert_array_equal(dut.zeta, late.zeta[:-2])
    np.testing.assert_array_equal(dut.goal, late.goal[:-2])
    assert dut.late == 0
    (raw,) = Flight(flight, Vehicle()).segments(0.02, labels.LabelConfig(np.inf, np.inf))
    assert raw.late == 0


def test_rows_without_a_label_part_the_flight(flight):
    flight.a[200:220] = np.nan
    first, second = Flight(flight, Vehicle()).segments(0.01)
    assert (len(first), len(second)) == (200, 380)
    np.testing.assert_array_equal(second.zeta, flight.x[220:, 7:13])


def test_an_array_keeps_its_own_step_and_its_wrench():
    chi = np.random.default_rng(0).normal(size=(50, 6))
    array = WrenchSequence(0.0025, chi, 2 * chi, "body")
    (dut,) = Flight(array, Vehicle()).segments(0.02)
    np.testing.assert_array_equal(dut.chi, chi)
    np.testing.assert_array_equal(dut.goal, chi)
    assert (dut.step, dut.late) == (0.0025, 0)


def test_a_segment_of_a_model_has_the_same_samples_and_its_own_labels(flight):
    class Reader:
        """Reads raw labels of slow rotors."""

        label = labels.LabelConfig(np.inf, np.inf)
        rotor_lag = 0.03

    flight.a[200:220] = np.nan
    pieces = flown_segments(flight, Vehicle(), Reader(), step=0.01)
    slow = dc.replace(Vehicle(), rotor_time_constant=0.03)
    raw = labels.labels(flight, slow, Reader.label)
    for (segment, seen), rows in zip(pieces, (slice(0, 200), slice(220, 600)), strict=True):
        np.testing.assert_array_equal(segment.zeta, seen.zeta)
        np.testing.assert_array_equal(seen.chi, raw[rows])
        np.testing.assert_array_equal(seen.x, flight.x[rows])
    np.testing.assert_allclose(
        pieces[1][1].u, flight.u[219:599]
    )  # the command since the row before
