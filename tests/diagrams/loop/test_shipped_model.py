"""Laws of the Neural Predictor that ships with the package."""

import numpy as np
import pytest

from diagrams.loop.controller_config import NP_MODEL
from diagrams.loop.flight_result import fly
from diagrams.studies.sweep import Row, configure
from np_drake.labels import smooth_labels
from np_drake.lifting.model.model_file import load_model
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.rigid_body import zeta
from np_drake.skill.skill import skill_table


@pytest.fixture(scope="module")
def rows():
    """Skill on a lemniscate that it has not seen, in steps of 20 ms."""
    config = configure("lemniscate", Row("nominal", "nominal"), solver="sqp")
    config.duration = 15.0
    flight = fly(config, seed=77)
    log = flight.log()
    models = {"shipped": NeuralPredictor.load(NP_MODEL)}
    table = skill_table(
        models,
        flight.signals["label"],
        zeta(log.x),
        horizons=[0, 5, 20, 40],
        mean=flight.signals["label"].mean(axis=0),
        target=smooth_labels(log, config.vehicle, config.controller.label),
        warm_up=250,
    )
    return {(row["model"], row["horizon"]): row for row in table}


def test_the_shipped_model_beats_every_naive_row_on_an_unseen_track(rows):
    for horizon in (5, 20, 40):
        assert rows["shipped", horizon]["force_skill"] < 0.85
    # Now, there is hardly anything to predict: the label is 40 ms old.
    assert rows["shipped", 0]["force_skill"] < 1.0


def test_the_shipped_model_is_stable_for_every_payload_and_small():
    family, rng = load_model(NP_MODEL).encoder, np.random.default_rng(0)
    for theta in rng.multivariate_normal(family.mean, 4 * family.covariance, size=50):
        assert family.system(theta, 0.02).spectral_radius <= 1.0
    assert NP_MODEL.stat().st_size < 2_000_000  # asked: 2 MB
