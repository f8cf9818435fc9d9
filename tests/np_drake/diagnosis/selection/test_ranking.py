import dataclasses as dc

import pytest

from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.regressors import Model
from np_drake.diagnosis.selection.ranking import drop_negligible
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.thrust_scale import ThrustScale

BOTH = (MassError(0.2), LinearDrag(0.6, 0.6, 0.6))


@pytest.fixture(scope="module")
def dut(ranked):
    return ranked(*BOTH)


def test_probabilities_are_probabilities_and_sure_of_what_acts(dut):
    found = dut.ranking.probability
    assert all(0.0 <= p <= 1.0 + 1e-9 for p in found.values())
    assert found["mass_error"] > 0.99
    assert found["linear_drag"] > 0.99
    assert all(p < 0.5 for name, p in found.items() if name not in ("mass_error", "linear_drag"))


def test_the_model_is_tried_without_its_faint_effects_all_and_each(dut):
    names = ["mass_error", "linear_drag", "thrust_scale"]
    problem = dut.ranking.problem
    at = {c.identifiers[0]: i for i, c in enumerate(problem.candidates) if len(c.identifiers) == 1}
    members = tuple(at[name] for name in names)
    faint = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(0.9999))))
    tried = drop_negligible(problem, Model(members, 0.0), faint)
    assert [m.members for m in tried] == [members[:2]]
    for scale, tried_without in ((0.995, True), (0.99, False)):
        strong = dc.replace(dut.fit, terms=(*dut.fit.terms, Term(ThrustScale(scale))))
        assert bool(drop_negligible(problem, Model(members, 0.0), strong)) is tried_without
