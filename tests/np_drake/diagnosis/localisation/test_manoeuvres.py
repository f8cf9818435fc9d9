"""Laws of the manoeuvres that show effects."""

import pytest

from np_drake.diagnosis.localisation import manoeuvre
from np_drake.effects.library import LIBRARY

PAIRS = [(a, b, how) for a, effect in LIBRARY.items() for b, how in effect.told_from.items()]


@pytest.mark.parametrize("name", LIBRARY)
def test_every_effect_of_the_library_has_a_manoeuvre_that_shows_it(name):
    assert manoeuvre((name,)) == LIBRARY[name].excited_by != ""


@pytest.mark.parametrize("a, b, how", PAIRS)
def test_a_known_pair_has_its_own_in_either_order(a, b, how):
    assert manoeuvre((a, b)) == manoeuvre((b, a)) == how
    assert b in LIBRARY


def test_another_pair_has_those_of_both_and_an_own_effect_a_general_one():
    text = manoeuvre(("linear_drag", "motor_lag"))
    assert LIBRARY["linear_drag"].excited_by in text
    assert LIBRARY["motor_lag"].excited_by in text
    assert "excites" in manoeuvre(("my_own",))
