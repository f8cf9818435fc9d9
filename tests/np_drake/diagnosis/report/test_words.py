"""Laws of numbers, units and names as text."""

import pytest

from np_drake.diagnosis.report import words as dut
from np_drake.diagnosis.result import Cause, Estimate


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
