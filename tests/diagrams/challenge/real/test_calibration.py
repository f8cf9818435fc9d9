"""Laws of calibration: honest probabilities lie on the diagonal."""

import numpy as np
import pytest

from diagrams.challenge.real.calibration import (
    bins,
    calibration_error,
    calibration_figure,
    calibration_table,
)


def test_honest_probabilities_lie_on_the_diagonal():
    draw = np.random.default_rng(0)
    p = draw.uniform(0, 1, 20_000)
    pairs = list(zip(p.tolist(), (draw.uniform(0, 1, p.size) < p).tolist(), strict=True))
    rows = bins(pairs)
    assert sum(row["n"] for row in rows) == p.size
    for row in rows:
        assert row["lower"] <= row["mean"] < row["upper"]
        assert row["rate"] == pytest.approx(
            row["mean"], abs=0.04
        )  # four deviations of the smallest bin


def test_a_certain_name_falls_in_the_last_bin_and_none_gives_no_bins():
    assert [row["n"] for row in bins([(1.0, True), (0.0, False)])] == [1, 1]
    assert bins([]) == []


def test_the_calibration_error_is_the_mean_distance_from_the_diagonal():
    pairs = [(0.8, True)] * 4 + [(0.8, False)] * 6 + [(1.0, True)] * 10
    assert calibration_error(pairs) == pytest.approx(0.5 * 0.4 + 0.5 * 0.0)
    assert calibration_error([]) is None
    assert [row[2] for row in calibration_table({"this": pairs})[2]] == [10, 10]


def test_the_figure_names_axes_and_series():
    figure = calibration_figure({"real flights": [(0.9, True), (0.4, False)], "nothing": []})
    top, below = figure.axes
    assert "share that is true" in top.get_ylabel()
    assert "probability" in below.get_xlabel()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "as reported",
        "real flights (n = 2)",
    ]
