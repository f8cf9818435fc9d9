import dataclasses as dc
from typing import ClassVar

import numpy as np
import pytest

from np_drake.effects.base import Parameter, WrenchEffect, correlation_root, prior_root, usual_size
from np_drake.effects.center_of_mass_offset import CenterOfMassOffset
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.library import LIBRARY, register
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.quadratic_drag import QuadraticDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

EFFECTS = pytest.mark.parametrize("effect", LIBRARY.values(), ids=LIBRARY.keys())

TABLE = """
mass_error delta_mass | inertia_error scale_xx scale_yy scale_zz | center_of_mass_offset x y z
suspended_payload mass length hook_x hook_y hook_z damping | thrust_scale scale | thrust_drift start rate
weak_rotor rotor efficiency | motor_lag time_constant | command_delay delay | linear_drag d_x d_y d_z
quadratic_drag c_x c_y c_z | blade_flapping moment | translational_lift lift | rotor_inflow slope
constant_wind x y z | gusty_wind mean_x mean_y mean_z deviation correlation_time | ground_effect effective_radius
rotor_gyroscopic rotor_inertia | accelerometer_bias x y z | gyro_bias x y z | velocity_bias x y z
attitude_bias roll pitch yaw | clock_offset offset
"""  # noqa: E501


def test_identifiers_and_parameters_are_those_of_the_file_format():
    rows = [
        entry.split() for line in TABLE.split("\n") for entry in line.split("|") if entry.strip()
    ]
    found = [[name, *(p.name for p in effect.parameters)] for name, effect in LIBRARY.items()]
    assert found[: len(rows)] == rows


@EFFECTS
def test_neutral_and_default_lie_within_the_bounds(effect):
    for values in (effect.neutral().values, effect().values):
        for p in effect.parameters:
            assert p.lower <= values[p.name] <= p.upper
            assert p.typical > 0
            assert not p.choices or values[p.name] in p.choices


@dc.dataclass(frozen=True)
class Push(WrenchEffect):
    force: float = 1.0
    identifier: ClassVar[str] = "push"
    parameters: ClassVar = (Parameter("force", "N", 0.0, -5.0, 5.0, 1.0),)


def test_an_own_effect_can_be_registered_twice_but_not_under_a_taken_name():
    try:
        assert register(register(Push)) is Push
        assert LIBRARY["push"] is Push
    finally:
        LIBRARY.pop("push", None)
    thief = dc.make_dataclass(
        "Thief", [], bases=(Push,), namespace={"identifier": "mass_error"}, frozen=True
    )
    with pytest.raises(ValueError, match="mass_error"):
        register(thief)


@pytest.mark.parametrize(
    "attributes, frozen, says",
    [
        ({"parameters": Push.parameters}, False, "must be a frozen dataclass"),
        ({"identifier": "lacks"}, True, "must have the attribute parameters"),
        ({"identifier": "l", "parameters": Push.parameters}, True, "must have a field 'force'"),
        (
            {"identifier": "draught", "parameters": (), "air_velocity": lambda self, t: t},
            True,
            r"must act by itself; .* never tried",
        ),
    ],
)
def test_an_own_effect_that_lacks_a_part_is_refused_by_its_name(attributes, frozen, says):
    own = dc.make_dataclass("Own", [], bases=(WrenchEffect,), namespace=attributes, frozen=True)
    own = own if frozen else type("Own", (WrenchEffect,), attributes)
    with pytest.raises(ValueError, match=f"register: Own {says}"):
        register(own)
    assert own.identifier not in LIBRARY


PAPER = Vehicle()
HEAVY = dc.replace(PAPER, mass=3 * PAPER.mass)
WIDE = dc.replace(PAPER, rotor_positions=(2 * np.array(PAPER.rotor_positions)).tolist())


@pytest.mark.parametrize(
    "effect, heavy, wide",
    [
        (MassError, 3, 1),
        (LinearDrag, 3, 1),
        (QuadraticDrag, 3, 1),
        (CenterOfMassOffset, 1, 2),
        (GyroBias, 1, 1),
    ],
    ids=lambda v: getattr(v, "identifier", str(v)),
)
def test_a_size_goes_with_the_mass_or_the_arm_of_the_vehicle_by_its_unit(effect, heavy, wide):
    p = effect.parameters[0]
    assert usual_size(p, HEAVY) == pytest.approx(heavy * p.typical)
    assert usual_size(p, WIDE) == pytest.approx(wide * p.typical)


def test_a_tether_is_as_long_whatever_the_vehicle():
    length = next(p for p in SuspendedPayload.parameters if p.name == "length")
    assert usual_size(length, WIDE) == length.typical


@EFFECTS
def test_the_prior_has_the_usual_sizes_as_deviations(effect):
    root = prior_root(effect, HEAVY)
    sizes = [usual_size(p, HEAVY) for p in effect.parameters if not p.choices]
    np.testing.assert_allclose(np.sqrt(np.diag(root @ root.T)), sizes, rtol=1e-12)


@pytest.mark.parametrize("effect", [LinearDrag, QuadraticDrag])
def test_level_axes_of_a_drag_are_alike_and_others_are_uncorrelated(effect):
    root = correlation_root(effect)
    np.testing.assert_allclose(root @ root.T, effect.prior_correlation, rtol=1e-12)
    assert (root @ root.T)[0, 1] > 0.9 > (root @ root.T)[0, 2] > 0
    np.testing.assert_array_equal(correlation_root(GyroBias), np.eye(3))


@pytest.mark.parametrize("value", ["a", np.nan, np.inf, None])
def test_an_effect_refuses_a_parameter_that_is_no_finite_number(value):
    with pytest.raises(ValueError, match=r"LinearDrag: d_y must be a finite number \[N·s/m\]; got"):
        LinearDrag(d_y=value)
