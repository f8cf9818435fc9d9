import numpy as np
import pytest

from diagrams.evidence.challenge.case import FILES, CaseDraw, SetRequest, compatible, draw_case
from diagrams.evidence.challenge.out_of_library import DEVELOPMENT, HOLDOUT
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.library import LIBRARY

OPTIONS = {"quality": "real", "seed": 5, "seconds": 8.0}


def case(name: str, kind: str = "single"):
    return draw_case(CaseDraw(3, kind, (name,) if name else ()), SetRequest(**OPTIONS))


def test_nothing_but_the_effect_depends_on_the_effect():
    one, other, clean = case("thrust_scale"), case("suspended_payload"), case("", "clean")
    t = np.arange(0, 8, 0.1)
    for file in FILES:
        for case_ in (other, clean):
            flat = case_.plans[file].targets(9.81, t)
            np.testing.assert_array_equal(flat, one.plans[file].targets(9.81, t))
            np.testing.assert_array_equal(case_.instants(file), one.instants(file))
    assert one.vehicle == other.vehicle == clean.vehicle
    assert one.quality == other.quality == clean.quality


@pytest.mark.parametrize("wind", ["constant_wind", "gusty_wind"])
def test_a_wind_comes_with_the_drag_that_feels_it(wind):
    assert [e.identifier for e in case(wind).effects] == [wind, "linear_drag"]


def test_gusts_differ_from_flight_to_flight():
    dut = case("gusty_wind")
    gusts = [dut.effects_of(file)[0] for file in FILES]
    assert all(isinstance(gust, GustyWind) for gust in gusts)
    assert len({gust.seed for gust in gusts}) == 3
    assert all(gust.values == dut.effects[0].values for gust in gusts)


def test_only_onset_cases_begin_in_mid_flight():
    assert set(case("linear_drag").onset.values()) == {None}
    begin = case("linear_drag", "onset").onset[FILES[0]]
    assert 2.0 <= begin <= 6.0


def test_a_set_has_the_shares_asked_for():
    kinds = [draw.kind for draw in SetRequest(cases=200, clean=30).draws()]
    counts = {kind: kinds.count(kind) for kind in set(kinds)}
    assert counts == {
        "single": 100,
        "pair": 30,
        "triple": 16,
        "onset": 24,
        "foreign": 30,
        "clean": 30,
    }


def test_single_effects_cycle_through_the_library():
    names = [draw.names[0] for draw in SetRequest(cases=88).draws() if draw.kind == "single"]
    assert set(names) == set(LIBRARY)
    assert max(names.count(name) for name in set(names)) <= 2


def test_joint_effects_act_at_different_places():
    for draw in SetRequest(cases=400, seed=1).draws():
        if draw.kind in ("pair", "triple"):
            places = {LIBRARY[name].place for name in draw.names}
            assert len(places) == {"pair": 2, "triple": 3}[draw.kind]
            assert compatible(draw.names)
    assert not compatible(("mass_error", "thrust_scale"))
    assert not compatible(("command_delay", "clock_offset"))


def test_held_out_effects_are_in_no_ordinary_set_and_alone_in_their_own():
    unseen = SetRequest(cases=64, clean=8, seed=1, unseen=True).draws()
    usual = SetRequest(cases=200, seed=1).draws()
    assert {name for d in usual if d.kind == "foreign" for name in d.names} == set(DEVELOPMENT)
    assert [d.kind for d in unseen].count("foreign") == 64
    assert {name for d in unseen for name in d.names} == set(HOLDOUT)
    assert not set(DEVELOPMENT) & set(HOLDOUT)
