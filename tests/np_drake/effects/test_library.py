import dataclasses as dc
from typing import ClassVar

import numpy as np
import pytest

from np_drake.effects.base import Parameter, WrenchEffect
from np_drake.effects.library import LIBRARY, register

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


@dc.dataclass(frozen=True)
class Draught(WrenchEffect):
    speed: float = 1.0
    identifier: ClassVar[str] = "draught"
    parameters: ClassVar = (Parameter("speed", "m/s", 0.0, -5.0, 5.0, 1.0),)

    def air_velocity(self, t):
        return np.broadcast_to([self.speed, 0.0, 0.0], (*np.shape(t), 3))


def test_what_is_felt_through_another_effect_alone_is_refused():
    with pytest.raises(ValueError, match=r"register: Draught must act by itself; .* never tried"):
        register(Draught)
    assert "draught" not in LIBRARY
