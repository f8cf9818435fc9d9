"""Laws of numbers, units and names as text."""

import math

import pytest

from np_drake.diagnosis.report import words as dut
from np_drake.diagnosis.result import Cause, Estimate, Finding
from np_drake.effects.library import LIBRARY


@pytest.mark.parametrize(
    "value, text",
    [
        (0.26041, "0.260"),
        (-0.0012, "−0.00120"),
        (1234.4, "1234"),
        (0.99996, "1.00"),
        (0.0, "0"),
        (3.2e-7, "3.20 × 10⁻⁷"),
        (float("nan"), "–"),
        (float("inf"), "–"),
        (None, "–"),
    ],
)
def test_a_number_has_three_significant_digits(value, text):
    assert dut.number(value) == text


@pytest.mark.parametrize(
    "value, unit, text",
    [
        (0.0048, "kg", "4.8 g"),
        (20.3, "kg", "20 kg"),
        (0.52, "m", "0.52 m"),
        (0.013, "m", "1.3 cm"),
        (0.005, "rad", "5.0 mrad"),
        (0.27, "rad", "15°"),
        (0.0118, "N", "12 mN"),
        (3.6e-5, "N·m", "36 µN·m"),
        (-4.2, "m/s", "−4.2 m/s"),
        (0.0013, "1/s", "0.13 %/s"),
        (2.0e-5, "kg·m²", "200 g·cm²"),
        (0.02, "s", "20 ms"),
        (12.0, "deg", "12°"),
        (7.0, "furlong", "7.0 furlong"),
        (float("nan"), "kg", "–"),
    ],
)
def test_a_size_has_the_unit_that_suits_it(value, unit, text):
    assert dut.measure(value, unit).replace(dut.NBSP, " ") == text


@pytest.mark.parametrize("name", LIBRARY)
def test_every_parameter_of_the_library_is_shown_with_a_known_unit(name):
    for p in LIBRARY[name].parameters:
        assert (p.unit or "1") in dut.UNITS or p.unit in ("m/s²",), p.unit


@pytest.mark.parametrize(
    "share, text",
    [
        (0.5, "50 %"),
        (0.9999, "> 99.9 %"),
        (1.0, "100 %"),
        (0.998, "99.8 %"),
        (1e-9, "< 0.1 %"),
        (-0.2, "−20 %"),
        (-0.001, "0 %"),
    ],
)
def test_a_share_is_never_rounded_to_certainty(share, text):
    assert dut.percent(share).replace(dut.NBSP, " ") == text


def test_nothing_inferred_is_certain():
    assert dut.probability(1.0) == ">\u00a099.9\u00a0%"
    assert dut.probability(0.0) == "<\u00a00.1\u00a0%"
    assert dut.percent_interval((0.93, 1.02)) == "93 to 100\u00a0%"


@pytest.mark.parametrize(
    "value, unit, ci95, text",
    [
        (0.004109, "kg", (0.003547, 0.004672), ("4.1 g", "3.5 to 4.7")),
        (0.26041, "kg", (0.2551, 0.2658), ("260 g", "255 to 266")),
        (21.37, "kg", (19.2, 23.5), ("21 kg", "19 to 24")),
        (1.2062, "m", (1.1990, 1.2133), ("1.206 m", "1.199 to 1.213")),
        (1.15e-5, "m", (-0.00205, 0.00207), ("0.0 cm", "−0.2 to 0.2")),
        (-0.0271, "rad", (-0.05, -0.004), ("−1.6°", "−2.9 to −0.2")),
        (3.0, "1", (float("nan"), float("nan")), ("3.0", "–")),
        (3.0, "furlong", (3.0 - 1e-9, 3.0 + 1e-9), ("3.00 furlong", "3.00 to 3.00")),
    ],
)
def test_an_estimate_has_the_digits_that_its_interval_tells(value, unit, ci95, text):
    found = dut.estimate(Estimate(value, unit, ci95), unit)
    assert tuple(part.replace(dut.NBSP, " ") for part in found) == text


def test_a_choice_is_a_whole_number_without_an_interval():
    assert dut.estimate(Estimate(4.0, "", (4.0, 4.0)), "1") == ("4", dut.NOTHING)


def said(identifier, **parameters):
    estimates = {n: Estimate(v, u, (0.9 * v, 1.1 * v)) for n, (v, u) in parameters.items()}
    return dut.phrase(Cause(identifier, 0.9, estimates, {})).replace(dut.NBSP, " ")


def test_a_phrase_has_the_size_of_the_cause():
    assert (
        said("suspended_payload", mass=(0.0048, "kg"), length=(0.52, "m"))
        == "a 4.8 g payload on 0.52 m"
    )
    assert said("thrust_scale", scale=(0.92, "1")) == "thrust at 92 % of nominal"
    assert said("mass_error", delta_mass=(-0.031, "kg")) == "a mass error of −31 g"
    assert (
        said("constant_wind", x=(3.0, "m/s"), y=(4.0, "m/s"), z=(0.0, "m/s"))
        == "a constant wind of 5.0 m/s"
    )
    drag = {"d_x": (0.24, "N·s/m"), "d_y": (0.31, "N·s/m"), "d_z": (0.1, "N·s/m")}
    assert said("linear_drag", **drag) == "linear drag of up to 0.31 N·s/m"
    assert said("inertia_error", scale_xx=(1.1, "1"), scale_yy=(0.9, "1")) == "an inertia error"
    assert said("sticky_rotor") == "sticky rotor"


def test_a_finding_is_described_with_the_figures_that_its_text_leaves_out():
    slow = Finding(
        "slow", "something slow below 0.5 Hz", 1.0, {"share": 0.04, "frequency": 0.5, "force": 0.9}
    )
    assert dut.described(slow) == "something slow below 0.5 Hz, 4\u00a0% of weight"
    burst = Finding("burst", "a push.", 1.0, {"time": 3.21, "force": 0.012})
    assert dut.described(burst) == "a push, at 3.2\u00a0s, 12\u00a0mN RMS"
    assert dut.described(Finding("twist", "a twist", 1.0, {"force": 0.0, "torque": 2e-4})).endswith(
        "0.20\u00a0mN·m RMS"
    )
    assert dut.described(Finding("x", "a thing", 1.0)) == "a thing"


def test_names_are_listed_as_one_says_them():
    assert dut.listed(["a"]) == "a"
    assert dut.listed(["a", "b", "c"]) == "a, b and c"
    assert dut.listed(["a", "b"], "or") == "a or b"


def test_every_effect_of_the_library_has_a_name():
    assert all(effect.named == dut.name_of(name) for name, effect in LIBRARY.items())
    assert dut.name_of("sticky_rotor") == "sticky rotor"
    assert dut.bare_name("suspended_payload") == "suspended payload"


def test_a_file_name_for_a_figure_is_short_and_has_signs_that_fonts_have():
    assert dut.plain_name("train_1.csv") == "train_1.csv"
    assert dut.plain_name("飞\n行") == "???"
    assert len(dut.plain_name("x" * 300)) == 36


def test_an_effect_that_is_absent_from_a_flight_has_no_time():
    assert dut.onset(8.0, "a").replace(dut.NBSP, " ") == "a: 8.0 s"
    assert dut.onset(math.inf, "a") == "a: not at all"
