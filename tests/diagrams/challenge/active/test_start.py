"""Laws of the vehicles and first flights of a loop."""

import numpy as np
import pytest

from diagrams.challenge.active.start import PAIRS, STARTS, withheld_case
from diagrams.challenge.generate.composition import compatible
from np_drake.effects.library import LIBRARY

SEEDS = range(60)


@pytest.fixture(scope="module")
def cases():
    return [withheld_case(seed, 0) for seed in SEEDS]


def test_equal_seeds_give_equal_vehicles(cases):
    again, other = withheld_case(3, 0), withheld_case(3, 1)
    assert (again.effects, again.vehicle, again.quality) == (
        cases[3].effects,
        cases[3].vehicle,
        cases[3].quality,
    )
    assert other.effects != again.effects
    assert len({withheld_case(3, attempt).draw.names for attempt in range(5)}) > 1


def test_effects_are_singles_and_compatible_pairs_of_the_library(cases):
    names = [case.draw.names for case in cases]
    assert all(set(n) <= set(LIBRARY) and (len(n) == 1 or compatible(n)) for n in names)
    share = np.mean([len(n) == 2 for n in names])
    assert abs(share - PAIRS) < 3 * np.sqrt(PAIRS * (1 - PAIRS) / len(SEEDS))  # three sigma of a binomial


def test_sensors_are_real_and_nothing_begins_in_flight(cases):
    assert all(case.quality.name == "real" and not any(case.onset.values()) for case in cases)


@pytest.mark.parametrize("name", STARTS)
def test_the_held_out_flight_is_another_of_the_same_kind(cases, name):
    start, t = STARTS[name], np.linspace(0.0, 5.0, 20)
    for case in cases[:5]:
        fitted, held_out = start.plans(case)
        assert fitted.kind == held_out.kind
        assert not start.kinds or fitted.kind in start.kinds
        assert not np.array_equal(fitted.reference.sample(t), held_out.reference.sample(t))
