"""Laws of the way from a log's rate to a predictor's step."""

import numpy as np
import pytest

from np_drake import labels
from np_drake.training_data.decimate import rows_at, wrench_sequence
from np_drake.training_data.wrench_sequence import WrenchSequence
from np_drake.vehicle import Vehicle


def test_a_whole_multiple_picks_every_second_row(flight):
    np.testing.assert_array_equal(rows_at(flight, 0.02), np.arange(0, len(flight), 2))


def test_any_other_step_picks_the_nearest_rows(flight):
    rows = rows_at(flight, 0.025)
    np.testing.assert_allclose(
        flight.t[rows], 0.025 * np.arange(len(rows)), atol=0.005 + 1e-12
    )  # half a row [s]
    assert len(rows) == 240


def test_labels_are_filtered_at_the_logs_own_rate(flight):
    dut = wrench_sequence(flight, Vehicle(), step=0.02)
    np.testing.assert_array_equal(dut.chi, labels.labels(flight, Vehicle())[::2])
    np.testing.assert_array_equal(dut.zeta, np.hstack([flight.v, flight.w])[::2])
    assert (dut.frame, dut.step, dut.total) == ("world", 0.02, False)


def test_zero_phase_targets_are_the_smooth_labels(flight):
    dut = wrench_sequence(flight, Vehicle(), step=0.02, zero_phase=True)
    np.testing.assert_array_equal(dut.chi, labels.smooth_labels(flight, Vehicle())[::2])


@pytest.mark.parametrize("step, message", [(0.005, "at least that of made"), (10.0, "lasts 5.99 s")])
def test_a_step_that_does_not_fit_is_refused(flight, step, message):
    with pytest.raises(ValueError, match=message):
        rows_at(flight, step)


@pytest.mark.parametrize(
    "bad", [{"frame": "moon"}, {"step": 0.0}, {"chi": np.zeros((5, 3))}, {"zeta": np.zeros((4, 6))}]
)
def test_a_sequence_of_wrong_shape_or_frame_is_refused(bad):
    good = {"step": 0.02, "chi": np.zeros((5, 6)), "zeta": np.zeros((5, 6))}
    with pytest.raises(ValueError, match="WrenchSequence"):
        WrenchSequence(**{**good, **bad}).check()
