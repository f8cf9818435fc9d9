"""Laws of `np-drake reproduce envelope`: what a network adds to its family on fresh flights."""

import numpy as np
import pytest

from diagrams.batch.arrays import packed
from diagrams.cli.main import run
from diagrams.loop.controller_config import FILTER_MODEL, NP_MODEL
from diagrams.prediction.envelope_study import HORIZONS, PERSISTENCE, Foreseeing, ratios
from np_drake.lifting.model.lifted_model import LIFTED, NEURAL
from np_drake.lifting.model.model_file import load_model
from np_drake.vehicle import Vehicle


class Steady:
    """An envelope whose flights hang below a constant weight."""

    seed, vehicle = 3, Vehicle()

    def __init__(self, samples):
        self.samples = samples

    def __call__(self, case):
        chi = np.tile([0, 0, -2.0, 0, 0, 0], (self.samples, 1))
        return {"segment": packed({"chi": chi, "zeta": np.zeros_like(chi), "goal": chi})}


def flight(speed, mass, lifted, neural):
    rmse = {
        PERSISTENCE: [1.0] * len(HORIZONS),
        LIFTED: [lifted] * len(HORIZONS),
        NEURAL: [neural] * len(HORIZONS),
    }
    return {"speed": speed, "mass": mass, "rmse": rmse}


def test_each_flight_counts_alike_in_every_group():
    lines = ratios(
        [flight(0.5, 0.1, 0.5, 0.4), flight(2.0, 0.1, 0.5, 0.25), flight(2.0, 0.0, 0.8, 0.8)]
    )
    found = {(line["group"], line["row"], line["over"], line["steps"]): line for line in lines}
    assert found["all", NEURAL, LIFTED, 10]["median"] == pytest.approx(0.8)
    assert found["all", LIFTED, PERSISTENCE, 40]["quantile"] == pytest.approx(
        np.quantile([0.5, 0.5, 0.8], 0.9)
    )
    assert found["above 1.8 m/s", NEURAL, LIFTED, 5]["median"] == pytest.approx(0.75)
    assert found["no payload", NEURAL, LIFTED, 5]["flights"] == 1
    assert not any(group == "above 0.3 kg" for group, *_ in found)


def test_a_force_that_stays_is_foreseen_by_persistence_exactly():
    model = load_model(NP_MODEL)
    result = Foreseeing(Steady(200), {LIFTED: model.without_network})({"flight": 0})
    assert result["rmse"][PERSISTENCE] == [0.0] * len(HORIZONS)
    assert np.all(np.isfinite(result["rmse"][LIFTED]))
    with pytest.raises(ValueError, match=r"flight 0: at least \d+ samples"):
        Foreseeing(Steady(20), {LIFTED: model.without_network})({"flight": 0})


def test_only_a_family_is_asked(capsys):
    assert run(["reproduce", "envelope", "--predictor", str(FILTER_MODEL)]) == 2
    assert "np_drake.lifted_model/1; got np_drake.payload_filter_model/1" in capsys.readouterr().err
