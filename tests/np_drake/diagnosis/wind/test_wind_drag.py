"""Laws of a drag that is added because gusts are felt through it."""

from np_drake.diagnosis.decision.infer import conclude
from np_drake.diagnosis.gusts import with_drag
from np_drake.diagnosis.regressors import DRAG
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

NEGLIGIBLE = LinearDrag(0.03, 0.03, 0.03)
GUSTS = GustyWind(0.0, 0.0, 0.0, 3.0, 0.8, seed=4)


def named(ranking) -> list[str]:
    return [t.effect.identifier for t in ranking.best.terms]


def test_gusts_act_through_a_drag_too_small_to_be_found_by_itself(ranked):
    case = ranked(NEGLIGIBLE, GUSTS)
    assert DRAG not in named(case.ranking)
    dut = conclude(case.found, case.held_out)
    causes = {c.identifier: c for c in dut.causes}
    assert list(causes) == [DRAG, "gusty_wind"]
    assert not dut.left.matters
    assert causes["gusty_wind"].probability > 0.85
    low, high = causes[DRAG].parameters["d_x"].ci95
    assert low < NEGLIGIBLE.d_x < high


def test_nothing_changes_where_flights_refuse_a_drag_or_name_it(ranked):
    for effects in ((), (CenterOfMassOffset(0.012, 0.007, 0.006),), (LinearDrag(0.6, 0.6, 0.6),)):
        ranking = ranked(*effects).ranking
        assert with_drag(ranking) is ranking
