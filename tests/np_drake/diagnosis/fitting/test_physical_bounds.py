"""Laws of physical bounds on fitted parameters."""

import pytest

from np_drake.diagnosis.fitting.physical_bounds import at_its_bound, impossible, interval
from np_drake.effects.base import Effect
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle

FLAT = Vehicle(inertia=[[0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.035]])  # at most twice 0.02 [kg·m²]


@pytest.mark.parametrize(
    "effect, at_end",
    [
        (ConstantWind(1.0, -15.0, 0.0), True),
        (LinearDrag(0.3, -0.2, 0.3), True),
        (ConstantWind(1.0, -14.0, 0.0), False),
        (MotorLag(0.0), False),  # neutral
        (WeakRotor(4, 0.9), False),  # a choice
    ],
    ids=str,
)
def test_a_figure_at_its_bound_is_none_unless_it_is_neutral(effect: Effect, at_end):
    assert at_its_bound(effect) is at_end


@pytest.mark.parametrize(
    "effect, deviation, possible",
    [
        (InertiaError(1.0, 1.0, 1.1), 0.01, True),
        (InertiaError(1.3, 1.2, 0.9), 0.01, True),
        (InertiaError(1.0, 1.0, 1.4), 0.01, False),  # more about z than about x and y together
        (InertiaError(1.0, 1.0, 1.4), 0.2, True),  # or not, for all that is known
        (InertiaError(0.5, 2.5, 1.0), 0.01, False),
        (InertiaError(1.0, 1.0, 1.0), 3.0, True),
        (CenterOfMassOffset(0.05, 0.0, 0.0), 0.01, True),
        (LinearDrag(0.6, 0.6, 0.6), 0.01, True),
    ],
    ids=str,
)
def test_an_inertia_that_no_rigid_body_has_stands_for_something_else(fit_at, effect, deviation, possible):
    why = impossible(fit_at(WeakRotor(2, 0.9), effect, covariance=deviation), 1, FLAT)
    assert why == ("" if possible else "no rigid body has such figures")


def test_a_figure_at_its_bound_stands_for_something_else(fit_at):
    assert "bound" in impossible(fit_at(LinearDrag(0.3, -0.2, 0.3), covariance=0.1), 0, FLAT)


@pytest.mark.parametrize(
    "effect, deviation, pushes",
    [
        (LinearDrag(0.3, -0.05, 0.3), 0.01, True),
        (LinearDrag(0.3, -0.05, 0.3), 0.03, False),  # for all that is known
        (QuadraticDrag(0.1, 0.1, -0.05), 0.01, True),
        (ConstantWind(1.0, -5.0, 0.0), 0.01, False),
        (CenterOfMassOffset(-0.05, 0.0, 0.0), 0.01, False),
    ],
    ids=str,
)
def test_a_drag_that_pushes_stands_for_something_else(fit_at, effect, deviation, pushes):
    fit = fit_at(WeakRotor(2, 0.9), effect, covariance=deviation)
    assert impossible(fit, 1, FLAT) == ("no drag pushes" if pushes else "")


def test_an_interval_is_that_of_the_figure_of_its_own_term(fit_at):
    fit = fit_at(LinearDrag(0.1, 0.2, 0.3), InertiaError(1.0, 1.1, 1.2), covariance=0.1)
    assert interval(fit, 1, "scale_yy") == pytest.approx((1.1 - 0.196, 1.1 + 0.196))
    assert interval(fit_at(WeakRotor(4, 0.9), covariance=0.1), 0, "rotor") == (4.0, 4.0)
