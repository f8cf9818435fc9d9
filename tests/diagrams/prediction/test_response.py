"""Laws of the response table, on made flights."""

import pytest

from diagrams.batch.run import Run
from diagrams.performance.predictor_bench import synthetic_flight
from diagrams.prediction import response as dut
from diagrams.prediction.array_flights import Flight
from np_drake.lifting.model.lifted_model import BY_AXES
from np_drake.lifting.training.train import make_config, train

NP = BY_AXES["body"]  # configuration of the row `np`


@pytest.fixture(scope="module")
def lines():
    training = Flight("training", synthetic_flight(1500, 0))
    tests = [Flight(f"test {k}", synthetic_flight(1500, k)) for k in (1, 2)]
    config = make_config(NP, frame="body")
    models = {NP: train([training.segment], config).model}
    return dut.response_lines(
        Run(), models, training, tests, config=config, settings={}, horizons=(10, 20)
    )


def test_every_row_flight_and_horizon_is_there(lines):
    rows = {"np", dut.UNSEEN, "persistence", "linear"}
    assert {line["row"] for line in lines} == rows
    assert len(lines) == len(rows) * 2 * 2


def test_persistence_is_late_by_its_horizon(lines):
    for line in lines:
        if line["row"] == "persistence":
            assert line["force_lag"] == pytest.approx(
                line["horizon"], abs=2e-4
            )  # [s] a tenth of a sample
            assert line["torque_lag"] == pytest.approx(line["horizon"], abs=2e-4)


def test_a_prediction_is_less_late(lines):
    for line in lines:
        if line["row"] == dut.UNSEEN:
            assert abs(line["force_lag"]) < 0.5 * line["horizon"]


def test_a_row_without_a_lag_says_so():
    line = {"row": "one", "horizon": 0.05, "force_lag": float("nan"), "force_correlation": 0.1}
    line |= {"torque_lag": 0.01, "torque_correlation": 0.9}
    _, header, rows = dut.printed([line, {**line, "torque_lag": float("nan")}])
    assert header[1] == "force, 50 ms ahead"
    assert rows == [("one", "none (0.10)", "10.0 (0.90, 1 without)")]
