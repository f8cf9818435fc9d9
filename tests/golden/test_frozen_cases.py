"""Frozen cases have the answers that were stored: six here, all of them by `make golden`."""

import copy

import pytest

from np_drake.effects.library import LIBRARY
from tests.golden.frozen_cases import STORED as FILE
from tests.golden.frozen_cases import answer, differences, golden_cases, read_answers

STORED = read_answers(FILE)
SUITE_TOLERANCE = 1e-4  # relative: another processor rounds otherwise in a long search
SUITE = (  # of all kinds; `make golden` compares all of them
    "single/suspended_payload/drake/clean",
    "single/inertia_error/rotorpy/real",
    "pair/mass_error+linear_drag/drake/clean",
    "onset/linear_drag/rotorpy/real",
    "foreign/twisted_cable/rotorpy/clean",
    "clean/90/drake/real",
)


@pytest.mark.parametrize("name", SUITE)
def test_a_frozen_case_is_answered_as_it_was(name):
    assert differences(STORED[name], answer(name), SUITE_TOLERANCE) == []


def test_every_effect_is_flown_alone_in_both_simulators_and_qualities():
    singles = [case for case in golden_cases().values() if case[2].kind == "single"]
    for position, values in ((0, {"drake", "rotorpy"}), (1, {"clean", "real"})):
        flown = {(case[position], case[2].names[0]) for case in singles}
        assert flown == {(value, name) for value in values for name in LIBRARY}


@pytest.mark.parametrize("off, lines", [(0.5e-6, 0), (2e-6, 1)])
def test_a_parameter_may_be_off_by_the_tolerance_of_its_size(off, lines):
    reference = STORED["single/constant_wind/drake/clean"]
    found = copy.deepcopy(reference)
    values = next(iter(found["causes"]["constant_wind"]["parameters"].values()))
    values[0] += off * max(map(abs, values))
    assert len(differences(reference, found, 1e-6)) == lines


def test_another_verdict_is_the_one_difference_that_is_told():
    reference = STORED["clean/90/drake/real"]
    found = {**copy.deepcopy(reference), "verdict": ["mass_error"], "unknown_probability": 1.0}
    assert differences(reference, found, 0.0) == [
        f"verdict: {reference['verdict']} -> ['mass_error']"
    ]
