"""Laws of the way from a flight to training input and to samples as a predictor sees them."""

import dataclasses as dc

import numpy as np

from np_drake import labels
from np_drake.training_data.segments import Flight, WrenchSequence, flown_segments
from np_drake.vehicle import Vehicle


def test_a_log_gives_causal_labels_and_zero_phase_targets(flight):
    (dut,) = Flight(flight, Vehicle()).segments(0.02)
    np.testing.assert_array_equal(dut.chi, labels.labels(flight, Vehicle())[::2])
    np.testing.assert_array_equal(dut.goal, labels.smooth_labels(flight, Vehicle())[::2])
    np.testing.assert_array_equal(dut.zeta, flight.x[::2, 7:13])
    assert dut.step == 0.02


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
    assert dut.step == 0.0025


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
