"""The estimation table on real flights, and its figure on a made one."""

import numpy as np
import pytest

from diagrams.batch.run import Run
from diagrams.performance.predictor_bench import synthetic_flight
from diagrams.prediction import array_flights, estimation
from diagrams.prediction.estimation_figures import FAR, window, window_figure
from np_drake.estimation.wrench_table import COLUMNS, PUBLISHED
from np_drake.files.figure_file import png
from np_drake.lifting.model.lifted_model import BY_AXES
from np_drake.lifting.training.train import make_config, train

NP = BY_AXES["body"]  # configuration of the row `np`


@pytest.fixture(scope="module")
def flown(neurobem):
    return array_flights.flights(neurobem)


def model(flown, name):
    return train([flown[0].segment], make_config(name, frame="body")).model


def test_one_step_ahead_the_default_is_below_the_paper_in_every_cell(flown):
    tests = [flight for flight in flown if "NP" in PUBLISHED.get(flight.name, {})]
    table = estimation.estimation_table(Run(), {NP: model(flown, NP)}, tests, {})
    assert list(table.cells) == [flight.name for flight in tests]
    assert table.ratios("np").shape == (10 * len(tests),)
    assert table.ratios("np").max() < 0.25
    assert table.ratios("persistence").max() <= 1.0  # the floor, not the goal
    for found in table.stability[NP].values():
        assert found.unstable == found.pulled == 0


def test_one_step_ahead_we_are_below_the_paper_on_race_track_1_but_for_f_y(flown):
    """One flight only, for time; `np-drake reproduce estimation` does all. The refit is as strong
    as 40 steps ask.
    """
    flight = array_flights.named(flown, "race track 1", "estimation")
    table = estimation.estimation_table(Run(), {"paper": model(flown, "paper")}, [flight], {})
    assert list(table.cells) == ["race track 1"]
    rows = table.cells["race track 1"]
    assert {c for c in COLUMNS if rows["np: paper"][c] > rows["NP"][c]} <= {"F_y"}
    found = table.stability["paper"]["race track 1"]
    assert found.unstable == 0
    assert found.windows == len(flight.segment) - 39


@pytest.fixture(scope="module")
def made():
    """A made flight and a model of it."""
    segment = synthetic_flight(1500, 0)
    fitted = train([segment], make_config(NP, frame="body")).model
    return fitted, array_flights.Flight("made", segment)


def test_published_rows_stand_as_printed(made):
    short = array_flights.Flight("melon 2", synthetic_flight(300, 0))
    table = estimation.estimation_table(Run(), {NP: made[0]}, [short], {})
    for method in estimation.METHODS:
        assert tuple(table.cells["melon 2"][method].values()) == PUBLISHED["melon 2"][method]


def test_the_figures_courses_stand_at_the_time_they_speak_of(made):
    fitted, flight = made
    shown = window({"np": fitted}, flight, (2.0, 3.0))
    rows = np.arange(800, 1200)
    assert list(shown.courses) == ["np", "persistence", "linear"]
    predicted, held, extrapolated = shown.courses.values()
    np.testing.assert_array_equal(shown.label, flight.segment.chi[rows])
    np.testing.assert_array_equal(held, flight.segment.chi[rows - FAR])
    np.testing.assert_allclose(
        extrapolated - held, FAR * (held - flight.segment.chi[rows - FAR - 1]), atol=1e-12
    )
    error = [np.sqrt(np.mean((c - shown.label)[:, :3] ** 2)) for c in (predicted, held)]
    assert error[0] < error[1]
    figure = window_figure(shown, "made")
    assert len(figure.axes) == 12
    assert all(ax.get_ylabel() for ax in figure.axes[::2])
    assert png(figure).startswith(b"\x89PNG")


def test_a_flight_that_ends_before_is_an_error(made):
    with pytest.raises(ValueError, match="must reach from 45 s to 55 s; it ends at"):
        window({"np": made[0]}, made[1])
