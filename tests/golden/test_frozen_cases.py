"""Frozen cases have the answers that were stored: ten here, all of them by `make golden`."""

from pathlib import Path

import pytest

from diagrams.challenge.golden import answer, differences, golden_cases, read_answers

STORED = read_answers(Path(__file__).with_name("answers.json"))
SUITE_TOLERANCE = 1e-4  # relative: another processor rounds otherwise in a search of some thousand products
SUITE = (  # ten of all kinds; `make golden` compares all of them
    "single/constant_wind/drake/clean",
    "single/weak_rotor/rotorpy/clean",
    "single/suspended_payload/drake/clean",
    "single/inertia_error/rotorpy/real",
    "pair/mass_error+linear_drag/drake/clean",
    "triple/center_of_mass_offset+constant_wind+command_delay/rotorpy/clean",
    "onset/linear_drag/rotorpy/real",
    "foreign/twisted_cable/rotorpy/clean",
    "clean/90/drake/real",
    "clean/95/rotorpy/clean",
)


@pytest.mark.parametrize("name", SUITE)
def test_a_frozen_case_is_answered_as_it_was(name):
    assert differences(STORED[name], answer(name), SUITE_TOLERANCE) == []


def test_all_cases_have_a_stored_answer():
    assert set(golden_cases()) <= set(STORED)
