"""Laws of the table of error against training samples, on made flights."""

import numpy as np
import pytest

from diagrams.batch.run import Run
from diagrams.performance.predictor_bench import synthetic_flight
from diagrams.prediction import sample_efficiency as dut
from diagrams.prediction.array_flights import OURS, Flight, configs
from np_drake.files.figure_file import png
from np_drake.lifting.training.train import make_config

SIZES = (600, 1200)
CONFIGS = {**configs(OURS, seed=0), "paper": make_config("paper", epochs=1)}


@pytest.fixture(scope="module")
def points():
    training, test = (
        Flight("training", synthetic_flight(1250, 0)),
        Flight("test", synthetic_flight(700, 1)),
    )
    return dut.sample_efficiency(Run(), training, test, CONFIGS, sizes=SIZES)


def test_pieces_are_disjoint_and_of_one_size():
    segment = synthetic_flight(4000, 0)
    for size, count in ((1000, 4), (2000, 2), (3000, 1), (4000, 1)):
        cut = dut.pieces(segment, size)
        assert [len(piece) for piece in cut] == count * [size]
        np.testing.assert_array_equal(
            np.concatenate([p.chi for p in cut]), segment.chi[: count * size]
        )


def test_every_model_size_and_horizon_has_its_point(points):
    trained = {(p.row, p.samples, p.pieces, p.horizon) for p in points if p.samples}
    expected = {
        (row, size, count, h)
        for row in ("np: paper", "np", "DMDc", "delay DMDc", "ridge by horizon")
        for size, count in ((600, 2), (1200, 1))
        for h in dut.HORIZONS
    }
    assert trained == expected
    assert {p.row for p in points if not p.samples} == {"persistence", "linear"}
    for p in points:
        for mean, low, high in (p.force, p.torque):
            assert low <= mean <= high
            assert mean > 0


def test_the_figure_has_a_panel_a_horizon_and_kind(points):
    figure = dut.efficiency_figure(points, 0.0025, "made")
    assert len(figure.axes) == 2 * len(dut.HORIZONS)
    assert png(figure).startswith(b"\x89PNG")


def test_a_size_beyond_the_segment_is_left_out():
    short = Flight("training", synthetic_flight(900, 0))
    found = dut.sample_efficiency(Run(), short, short, {}, sizes=SIZES)
    assert {p.samples for p in found if p.row in dut.BASELINES} == {600}


def test_on_its_own_flight_no_baseline_of_ten_samples_is_worse_than_one():
    """One step ahead: what is kept stable would be."""
    flight = Flight("training", synthetic_flight(1250, 0))
    found = dut.sample_efficiency(Run(), flight, flight, {}, sizes=(1200,))
    error = {p.row: p.force[0] for p in found if p.horizon == 1}
    assert error["delay DMDc"] <= 1.01 * error["DMDc"]


def test_too_short_a_segment_is_an_error():
    short = Flight("training", synthetic_flight(500, 0))
    with pytest.raises(ValueError, match="must have 600 samples; got 500"):
        dut.sample_efficiency(Run(), short, short, CONFIGS, sizes=SIZES)
