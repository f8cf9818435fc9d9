"""Laws of the flights over the envelope of a vehicle, and of the share of a network that flies."""

from types import SimpleNamespace

import pytest

from diagrams.batch.run import unpacked
from diagrams.loop.controller_config import NP_MODEL
from diagrams.studies.learning import (
    LENGTH,
    MASS,
    SPEED,
    envelope_flight,
    flown_segment,
    flown_share,
)
from np_drake.lifting.model.lifted_model import load_model
from np_drake.vehicle import Vehicle


def test_flights_lie_within_the_envelope():
    for number in range(40):
        config = envelope_flight(number, seed=3, vehicle=Vehicle())
        hung = config.reality.payload
        assert hung.tether == "none" or (
            MASS[0] <= hung.mass <= MASS[1] and LENGTH[0] <= hung.length <= LENGTH[1]
        )
        assert SPEED[0] <= config.reference.speed <= SPEED[1]


@pytest.mark.nightly
def test_what_is_learnt_is_what_a_vehicle_measures():
    arrays = unpacked(flown_segment({"flight": 2}, seed=3, vehicle=Vehicle())["segment"])
    config = envelope_flight(2, seed=3, vehicle=Vehicle())
    weight = config.reality.payload.mass * 9.81
    drift = (config.reality.thrust_scale - 1.0) * (Vehicle().mass * 9.81 + weight)
    assert arrays["goal"][200:, 2].mean() == pytest.approx(-weight + drift, abs=0.15 * weight + 0.3)
    assert set(arrays) == {"chi", "zeta", "goal"}


def flying(error):
    """Stand-in of a run whose flight with a share errs by error(share), or is lost: None."""

    def cases(title, what, work, cases, **more):
        errors = [error(case["share"]) for case in cases]
        return [{"error": "lost"} if e is None else {"result": {"error": e}} for e in errors]

    return SimpleNamespace(seed=0, cases=cases)


@pytest.mark.parametrize(
    "error, best", [(lambda s: 1 + (s - 0.5) ** 2, 0.5), (lambda s: 2 - s if s < 1 else None, 0.75)]
)
def test_the_share_that_flies_best_is_used(error, best):
    model = load_model(NP_MODEL)
    chosen = flown_share(model, 40, run=flying(error), vehicle=Vehicle())
    assert chosen.encoder.network.share == pytest.approx(best * model.encoder.network.share)
    assert chosen.summary["network"]["flights_flown"] == 4
    alone = model.without_network
    assert flown_share(alone, 40, run=flying(error), vehicle=Vehicle()) is alone
