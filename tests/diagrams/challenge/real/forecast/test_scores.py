import numpy as np
import pytest

from diagrams.challenge.real.forecast.rows import PERSISTENCE
from diagrams.challenge.real.forecast.scores import Score, diverged, pooled, score
from np_drake.labels import LabelConfig
from np_drake.residual_models.hold import Constant, Hold
from np_drake.skill.skill import flight_forecasts
from np_drake.training_data.training_segments import sampled_flight


def made(row, flight, square, motion="known", peak=1.0):
    """A score of one horizon and four origins whose lateral force has this squared error in all."""
    return Score(row, flight, motion, np.full((3, 1), square), np.array([4]), np.array([peak, 1.0]))


def both(row, flight, square):
    return [made(row, flight, square, motion) for motion in ("known", "held")]


def test_a_ratio_is_that_of_the_pooled_errors():
    scores = both(PERSISTENCE, "a", 4.0) + both(PERSISTENCE, "b", 12.0)
    scores += both("mine", "a", 4.0) + both("mine", "b", 5.0)
    (line,) = [
        x
        for x in pooled(scores, [5], 0.02)
        if (x["row"], x["motion"], x["kind"]) == ("mine", "known", "force")
    ]
    assert line["ratio"] == pytest.approx(np.sqrt(9 / 16))
    assert line["rmse"] == pytest.approx(np.sqrt(9 / 8))
    assert line["horizon"] == pytest.approx(0.1)
    np.testing.assert_allclose(
        line["interval"], [np.sqrt(5 / 12), 1.0]
    )  # only b is drawn, or only a


def test_a_flight_diverges_by_its_longest_forecast():
    scores = [
        made("mine", "a", 1.0, peak=9.0),
        made("mine", "b", 1.0, peak=11.0),
        made("mine", "c", 1.0, peak=np.inf),
    ]
    assert diverged(scores, "mine", "known") == ["b", "c"]
    assert diverged(scores, "mine", "held") == []


def test_the_error_is_that_against_the_averaged_label(cones):
    log, vehicle = cones[0].log, cones[0].vehicle
    flight = sampled_flight(log, vehicle, step=0.02)
    mean = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    found = score(
        "mean", Constant(mean, step=0.02, name="training mean"), (log, vehicle), [1, 10], first=30
    )
    error = (flight.chi[40:] - mean) ** 2
    assert found[0].count.tolist() == [len(flight) - 31, len(flight) - 40]
    assert found[0].square[0, 1] == pytest.approx(error[:, :2].sum())
    assert found[1].square[1, 1] == pytest.approx(error[:, :3].sum())


def test_a_forecast_that_is_no_number_diverges(cones):
    model = Constant(np.full(6, np.inf), step=0.02, name="training mean")
    found = score("inf", model, (cones[0].log, cones[0].vehicle), [1], first=30)
    assert all(s.diverged for s in found)


def test_a_model_with_a_low_pass_of_its_own_gets_its_labels(cones):
    log, vehicle = cones[0].log, cones[0].vehicle
    model = Hold(step=0.02)
    model.label = LabelConfig(1.0, 1.0)
    seen = sampled_flight(log, vehicle, step=0.02, label=model.label)
    chi_hat = flight_forecasts(model, seen, [1], first=30, motion="known")[:-1, 0]
    error = (sampled_flight(log, vehicle, step=0.02).chi[31:] - chi_hat) ** 2
    found = score("low", model, (log, vehicle), [1], first=30)
    assert found[0].square[0, 0] == pytest.approx(error[:, :2].sum())


def test_a_flight_without_an_origin_is_refused(cones):
    with pytest.raises(ValueError, match="must last more than"):
        score("hold", Hold(step=0.02), (cones[0].log, cones[0].vehicle), [1], first=500)
