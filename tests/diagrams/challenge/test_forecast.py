"""Laws of the forecasts on real flights with a payload."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from diagrams.challenge import forecast
from diagrams.challenge.forecast import (
    HISTORY,
    HORIZONS,
    PERSISTENCE,
    STEP,
    HoldingOut,
    Options,
    pooled,
    square_errors,
)
from diagrams.cli.main import run
from np_drake.effects.pendulum import Payload
from np_drake.residual_models.hold import Constant, Hold
from np_drake.training_data.training_segments import sampled_flight
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def cones():
    """Conical swings of three angles, two flights each: three manoeuvres of exact pendulums."""
    path = Path(__file__).parents[2] / "np_drake" / "skill" / "conical_flight.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    payload, found = Payload(mass=0.1, length=0.6, hook=(0.0, 0.0, 0.0)), {}
    for number, angle in enumerate((0.2, 0.3, 0.4)):
        for twin in range(2):
            v, name = np.array([0.5 * twin, 0.3 * number, 0.0]), f"{number}{twin}"
            log, _ = module.conical_flight(Vehicle(), payload, angle=angle, velocity=v, name=name)
            found.setdefault(f"angle {angle}", []).append((log, Vehicle()))
    return found


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


def test_the_error_is_that_against_the_averaged_label(cones):
    opened = cones["angle 0.2"][0]
    flight, mean = sampled_flight(*opened, step=STEP), np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    found = square_errors(Constant(mean, step=STEP, name="mean"), opened, "known")
    first = HISTORY + HORIZONS[2]
    error = (flight.chi[first:] - mean) ** 2
    assert found["count"][2] == len(flight) - first
    assert found["square"][0][2] == pytest.approx(error[:, :2].sum())
    assert found["square"][1][2] == pytest.approx(error[:, :3].sum())


def test_no_row_is_trained_on_the_manoeuvre_that_it_is_scored_on(cones, monkeypatch):
    seen = []

    def trained(flights):
        seen.extend(log.name for log, _ in flights)
        return Hold(step=STEP)

    monkeypatch.setitem(forecast.ROWS, "mine", trained)
    found = HoldingOut(cones)({"manoeuvre": "angle 0.3", "row": "mine"})
    assert seen == ["00", "01", "20", "21"]
    assert list(found["known"]) == list(found["held"]) == ["10", "11"]


@pytest.mark.parametrize(
    "arguments, word",
    [([], "NP_DRAKE_REAL"), (["nowhere"], "not there"), (["nowhere", "--only", "x"], "--only")],
)
def test_bad_input_is_one_line(capfd, monkeypatch, arguments, word):
    monkeypatch.delenv("NP_DRAKE_REAL", raising=False)
    assert run(["reproduce", "payload-flights", *arguments]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text]
    assert word in line


@pytest.mark.nightly
def test_on_the_real_flights_a_ridge_does_what_the_prototype_did(real_flights):
    from diagrams.batch.run import Run

    report = forecast.run(Run(), Options(real_flights, ["ridge"]))
    lines = [x for x in report.metrics["table"] if (x["row"], x["motion"]) == ("ridge", "known")]
    own = {round(x["horizon"], 3): x["ratio"] for x in lines if x["kind"] == "lateral force"}
    got = [own[h] for h in (0.1, 0.2, 0.4, 0.8)]
    # Its labels were not described to the last bit.
    np.testing.assert_allclose(got, (0.54, 0.48, 0.55, 0.54), rtol=0.1)
    assert len(report.tables) == 6
