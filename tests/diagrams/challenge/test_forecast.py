"""Laws of the forecasts on real flights with a payload."""

import numpy as np
import pytest

from diagrams.challenge import forecast
from diagrams.challenge.forecast import (
    HISTORY,
    HORIZONS,
    PERSISTENCE,
    STEP,
    held_out_errors,
    pooled,
    square_errors,
)
from diagrams.cli.main import run
from np_drake.effects.linear_drag import LinearDrag
from np_drake.residual_models.hold import Constant, Hold
from np_drake.training_data.segments import sampled_flight
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis.simulated_flights import fly


@pytest.fixture(scope="module")
def manoeuvres():
    """Three manoeuvres of two flights each, with drag."""
    drag = LinearDrag(0.3, 0.3, 0.3)
    flights = [fly(drag, name=f"made_{k}", seed=k, seconds=4.0) for k in range(6)]
    return {f"{k}": [(log, Vehicle()) for log in flights[2 * k : 2 * k + 2]] for k in range(3)}


def test_a_ratio_is_that_of_the_pooled_errors():
    def own(*squares):
        one = {"count": [4] * len(HORIZONS)}
        shape = (3, len(HORIZONS))
        return {n: {**one, "square": np.full(shape, s)} for n, s in zip("ab", squares, strict=True)}

    lines = pooled({(PERSISTENCE, "known"): own(4.0, 12.0), ("mine", "known"): own(4.0, 5.0)})
    line = next(x for x in lines if (x["row"], x["kind"]) == ("mine", "force"))
    assert line["ratio"] == pytest.approx(np.sqrt(9 / 16))
    assert line["rmse"] == pytest.approx(np.sqrt(9 / 8))
    assert line["horizon"] == STEP * HORIZONS[0]
    assert line["interval"] == pytest.approx([np.sqrt(5 / 12), 1.0])  # only b is drawn, or only a


def test_the_error_is_that_against_the_averaged_label(manoeuvres):
    opened = manoeuvres["0"][0]
    flight, mean = sampled_flight(*opened, step=STEP), np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    found = square_errors(Constant(mean, step=STEP, name="mean"), opened, "known")
    first = HISTORY + HORIZONS[2]
    error = (flight.chi[first:] - mean) ** 2
    assert found["count"][2] == len(flight) - first
    assert found["square"][0][2] == pytest.approx(error[:, :2].sum())
    assert found["square"][1][2] == pytest.approx(error[:, :3].sum())


def test_no_row_is_trained_on_the_manoeuvre_that_it_is_scored_on(manoeuvres, monkeypatch):
    seen = []

    def trained(flights):
        seen.extend(log.name for log, _ in flights)
        return Hold(step=STEP)

    monkeypatch.setitem(forecast.ROWS, "mine", trained)
    found = held_out_errors({"manoeuvre": "1", "row": "mine"}, flights=manoeuvres)
    assert seen == ["made_0", "made_1", "made_4", "made_5"]
    assert list(found["known"]) == list(found["held"]) == ["made_2", "made_3"]


@pytest.mark.parametrize(
    "arguments, word",
    [([], "NP_DRAKE_REAL"), (["nowhere"], "not there"), (["nowhere", "--only", "x"], "--only")],
)
def test_bad_input_is_one_line(capfd, monkeypatch, arguments, word):
    monkeypatch.delenv("NP_DRAKE_REAL", raising=False)
    assert run(["reproduce", "payload-flights", *arguments]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text]
    assert word in line
