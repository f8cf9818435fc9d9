"""Laws of the explanations that still stand after a diagnosis."""

import math

import numpy as np
import pytest

from np_drake.diagnosis.decision import causes as explanations
from np_drake.diagnosis.decision.causes import explanations_of
from np_drake.diagnosis.decision.infer import infer
from np_drake.effects.explanation import STANDS
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

POOR = {"noise": 5.0, "attitude_noise": 0.01, "seconds": 6.0, "vigour": 0.06}  # a noisy hover


def standing(seen, *effects, **how):
    flights = [seen(*effects, name=n, seed=i, **how) for i, n in enumerate("ab", start=1)]
    found = infer(flights[:1], flights[1:])
    return found, explanations_of(found.ranking, found.held)


@pytest.fixture(scope="module")
def hover(seen, quick_searches):
    return standing(seen, MassError(0.2), **POOR)


def test_in_hover_mass_and_thrust_both_stand(hover):
    _, dut = hover
    assert {("mass_error",), ("thrust_scale",)} <= {e.named for e in dut}
    assert sum(e.probability for e in dut) == pytest.approx(1.0, abs=1e-12)
    assert [e.probability for e in dut] == sorted((e.probability for e in dut), reverse=True)


def test_what_stands_is_near_the_best_or_named_as_the_same(hover):
    found, dut = hover
    same = {name for cause in found.causes for name in cause.indistinguishable_from}
    for e in dut:
        assert e.probability > dut[0].probability / STANDS or same & {*e.named}
    assert same <= {name for e in dut for name in e.named}


def test_every_explanation_tells_how_unsure_its_parameters_are(hover):
    for e in hover[1]:
        assert len(e.parameters) == len(set(e.parameters)) == len(e.covariance)
        assert np.linalg.eigvalsh(e.covariance).min() > 0
        free = [f"{effect.identifier}.{p.name}" for effect in e.effects for p in effect.parameters]
        assert set(free) <= set(e.parameters)
    mass = next(e for e in hover[1] if e.named == ("mass_error",))
    deviation = math.sqrt(mass.covariance[mass.parameters.index("mass_error.delta_mass")][0])
    assert abs(mass.effects[0].values["delta_mass"] - 0.2) < 4 * deviation


def test_a_plain_cause_stands_alone(seen, quick_searches):
    _, dut = standing(seen, LinearDrag(0.6, 0.6, 0.6), noise=1.0, seconds=8.0)
    assert [e.named for e in dut] == [("linear_drag",)]
    assert dut[0].probability == 1.0


def test_probabilities_add_up_where_the_likeliest_fits_are_impossible(hover, monkeypatch):
    ranking = hover[0].ranking
    monkeypatch.setattr(explanations, "is_possible", lambda *_: False)
    monkeypatch.setattr(
        explanations, "score_of", lambda fit, _: -2000.0 if fit is ranking.fits[0] else 0.0
    )
    assert sum(e.probability for e in explanations_of(ranking, hover[0].held)) == pytest.approx(1.0)
