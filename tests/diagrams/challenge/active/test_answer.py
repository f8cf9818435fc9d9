"""Laws of an answer: what stands, whether it is settled, and whether it is right."""

import math

import pytest


def test_a_swap_beyond_a_factor_of_twenty_no_longer_stands(answered):
    assert [e.label for e in answered(0.93, 0.05, 0.02).standing] == ["linear_drag", "quadratic_drag"]
    assert answered(0.97, 0.03).settled


def test_what_no_effect_explains_leaves_the_answer_open(answered):
    assert not answered(1.0, 0.0, verdict=("linear_drag", "unknown")).settled


def test_the_next_flight_separates_what_stands(answered):
    assert len(answered(0.5, 0.48, 0.02).explanations) == 2
    assert len(answered(0.97, 0.03).explanations) == 2  # one stands: all that came near


def test_entropy_is_that_of_the_probabilities(answered):
    assert answered(0.5, 0.5).entropy == pytest.approx(math.log(2))
    assert answered(1.0, 0.0).entropy == 0.0
    assert math.isnan(answered(0.0, 0.0).entropy)


def test_only_the_exact_effects_are_the_right_explanation(answered):
    dut = answered(0.97, 0.03).record()
    assert (dut["right_alone"], dut["right_stands"]) == (True, True)
    dut = answered(0.03, 0.97).record()
    assert (dut["right_alone"], dut["right_stands"]) == (False, False)
    assert answered(0.3, 0.7).record()["right_stands"]


def test_the_verdict_is_scored_as_the_challenge_does(answered):
    assert answered(0.5, 0.5).record()["right_class"]
    assert not answered(0.5, 0.5, verdict=()).record()["right_class"]
    assert not answered(0.5, 0.5, verdict=("linear_drag", "unknown")).record()["right_class"]
