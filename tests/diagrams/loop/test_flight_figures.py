"""Figures, tables and words of a flight."""

import numpy as np
import pytest

from diagrams.loop import flight_figures
from np_drake.files.figure_file import png


@pytest.fixture
def flight(flown):
    return flown("circle", "hold")


@pytest.mark.parametrize("what", ["track", "errors", "wrench", "overlay"])
def test_every_axis_has_a_label_with_its_unit_and_the_figure_a_legend(flight, what):
    figure = flight_figures.overlay([flight, flight]) if what == "overlay" else flight.plot(what)
    axes = figure.get_axes()
    assert all("[" in ax.get_ylabel() for ax in axes)
    assert any("[" in ax.get_xlabel() for ax in axes)
    assert figure.legends
    assert png(figure).startswith(b"\x89PNG")


def test_the_data_frame_of_a_flight_holds_log_reference_and_truth(flight):
    frame = flight.to_dataframe()
    np.testing.assert_array_equal(frame[["px_ref", "py_ref", "pz_ref"]], flight.signals["p_ref"])
    np.testing.assert_array_equal(frame["fz_true"], flight.chi_true[:, 2])
    np.testing.assert_array_equal(frame["fz_predicted"], flight.signals["chi_hat"][:, 2])
    np.testing.assert_array_equal(frame["px"], flight.log().p[:, 0])
