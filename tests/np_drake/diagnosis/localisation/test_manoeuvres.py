"""Laws of the manoeuvres that show effects."""

import pytest

from np_drake.diagnosis.localisation.manoeuvres import PAIRS, SHOWS, manoeuvre
from np_drake.effects.library import LIBRARY


@pytest.mark.parametrize("name", LIBRARY)
def test_every_effect_of_the_library_has_a_manoeuvre_that_shows_it(name):
    assert manoeuvre((name,)) == SHOWS[name]


@pytest.mark.parametrize("pair", PAIRS, ids=lambda p: "+".join(sorted(p)))
def test_a_known_pair_has_its_own_in_either_order(pair):
    a, b = sorted(pair)
    assert manoeuvre((a, b)) == manoeuvre((b, a)) == PAIRS[pair]
    assert pair <= LIBRARY.keys()


def test_another_pair_has_those_of_both_and_an_own_effect_a_general_one():
    text = manoeuvre(("linear_drag", "motor_lag"))
    assert SHOWS["linear_drag"] in text
    assert SHOWS["motor_lag"] in text
    assert "excites" in manoeuvre(("my_own",))
