"""Laws of one look: how what remains becomes a verdict."""

import pytest

from np_drake.diagnosis import look as dut_module
from np_drake.diagnosis.look import look
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

DRAG, GUSTS = LinearDrag(0.3, 0.3, 0.3), GustyWind(0.0, 0.0, 0.0, 3.0, 0.8, seed=4)


@pytest.mark.parametrize(("chance", "gusts"), [(0.5, True), (1e-6, False)])
def test_a_slow_force_that_follows_the_place_is_unknown_and_not_gusts(ranked, monkeypatch, chance, gusts):
    case = ranked(DRAG, GUSTS)
    monkeypatch.setattr(dut_module, "chance_of_place", lambda *_: chance)
    dut = look(case.flights, case.unseen)
    assert ("gusty_wind" in {c.identifier for c in dut.causes}) == gusts == dut.gusty
    assert dut.unknown != gusts
    assert ("place" in {f.name for f in dut.left.findings}) != gusts
