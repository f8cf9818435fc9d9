"""Laws of what a notebook shows of a log, and of the path of a neighbour."""

import numpy as np
import pytest

from np_drake.flight_log import FlightLog, Neighbour

ROWS = 50
LOG = FlightLog(
    t=0.02 * np.arange(ROWS),
    p=np.tile([0.0, 1.0, 2.0], (ROWS, 1)),
    q=np.tile([1.0, 0, 0, 0], (ROWS, 1)),
    v=np.zeros((ROWS, 3)),
    w=np.zeros((ROWS, 3)),
    u=np.tile([9.81, 0, 0, 0], (ROWS, 1)),
    rotor=np.full((ROWS, 4), 500.0),
    name="<circle>",
    notes=[f"note {k}" for k in range(9)],
)


def test_a_log_says_name_rows_length_rate_and_input():
    assert repr(LOG) == "FlightLog('<circle>': 50 rows, 1.0 s at 50 Hz, input command)"
    page = LOG._repr_html_()
    assert "&lt;circle&gt;" in page
    assert "9.81 to 9.81" in page
    assert page.count("<p>note") == 5


def test_data_frames_hold_the_values_with_the_times_as_index():
    frame = LOG.to_dataframe()
    np.testing.assert_array_equal(frame.index, LOG.t)
    np.testing.assert_array_equal(frame[["px", "py", "pz"]], LOG.p)


def test_a_log_draws_track_height_speed_and_thrust_with_units():
    figure = LOG.plot()
    assert all("[" in ax.get_ylabel() for ax in figure.get_axes())
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_a_path_is_linear_between_its_rows_and_unknown_beyond():
    dut = Neighbour(np.array([0.0, 2.0]), np.array([[0.0, 1.0, 2.0], [4.0, 1.0, 0.0]]))
    np.testing.assert_allclose(dut.at(0.5), [1.0, 1.0, 1.5], atol=1e-12)
    assert dut.at(np.zeros((3, 2))).shape == (3, 2, 3)
    assert np.isnan(dut.at([-0.1, 2.1])).all()


@pytest.mark.parametrize(
    "t, p, says",
    [
        ([0.0], [[0.0, 0.0, 0.0]], "two rows at least"),
        ([0.0, 1.0], [[0.0, 0.0], [0.0, 0.0]], "positions"),
        ([0.0, 0.0], np.zeros((2, 3)), "increasing"),
        ([0.0, 1.0], [[0.0, 0.0, np.nan], [0.0, 0.0, 0.0]], "finite"),
    ],
)
def test_what_is_no_path_is_refused_in_one_line(t, p, says):
    with pytest.raises(ValueError, match=f"^other: must have .*{says}"):
        Neighbour(np.array(t), np.array(p), "other")
