"""Laws of the share of a network that flies."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.loop.controller_config import NP_MODEL
from diagrams.tracking.network_share import SHARES, best_share, flown_share
from np_drake.lifting.model.model_file import load_model
from np_drake.vehicle import Vehicle


def run(error):
    """Stand-in of a run whose flight with a share errs by error(share); None: the vehicle is
    lost.
    """

    def cases(title, what, work, cases, **more):
        errors = [error(case["share"]) for case in cases]
        return [{"error": "lost"} if e is None else {"result": {"error": e}} for e in errors]

    return SimpleNamespace(seed=0, cases=cases)


@pytest.mark.parametrize(
    "error, best", [(lambda s: 1 + (s - 0.5) ** 2, 0.5), (lambda s: 2 - s if s < 1 else None, 0.75)]
)
def test_the_share_that_flies_best_is_used(error, best):
    model = load_model(NP_MODEL)
    chosen = flown_share(model, 40, run=run(error), vehicle=Vehicle())
    assert chosen.encoder.network.share == pytest.approx(best * model.encoder.network.share)
    assert chosen.summary["network"]["flights_flown"] == 4


def test_a_flight_is_flown_with_the_model_of_its_share(monkeypatch):
    def fly(config, seed):
        assert (config.controller.kind, seed) == ("np", 5)
        share = load_model(config.controller.predictor).encoder.network.share
        return SimpleNamespace(metrics=lambda: {"position_rmse": 1 + share})

    work = {}

    def keep(title, what, flying, cases, **more):
        work.update(
            {case["share"]: flying({"flight": 5, "share": case["share"]}) for case in cases}
        )
        return [{"result": work[case["share"]]} for case in cases]

    monkeypatch.setattr("diagrams.tracking.network_share.fly", fly)
    model = load_model(NP_MODEL)
    flown_share(model, 10, run=SimpleNamespace(seed=0, cases=keep), vehicle=Vehicle())
    own = model.encoder.network.share
    assert {share: found["error"] for share, found in work.items()} == {
        share: 1 + share * own for share in SHARES
    }


def test_where_every_share_flies_worse_there_is_none():
    assert best_share(np.tile(1.0 + np.array(SHARES), (3, 1))) == 0.0
    assert best_share(np.ones((3, len(SHARES)))) == 0.0
    assert best_share(np.full((3, len(SHARES)), np.inf)) == 0.0


def test_a_family_without_network_is_not_flown():
    model = load_model(NP_MODEL).without_network
    assert flown_share(model, 40, run=run(lambda share: 1.0), vehicle=Vehicle()) is model
