"""A vehicle file from what an owner can measure: mass, wheelbase, propeller diameter and hover throttle.

Every other parameter is an estimate with a stated formula, good enough to fly in simulation and to begin a diagnosis
with; measured values should take its place.
"""  # noqa: E501

import dataclasses as dc
import math

from np_drake.files.yaml_file import POSITIVE, check_fields, number, word
from np_drake.vehicle.rotor_layout import FIRMWARE, PROPS, directions_of, places
from np_drake.vehicle.vehicle import AIR, GRAVITY, Vehicle, least_torque_over_thrust

AT_ROTORS = 0.5  # share of the mass at the rotors: motors, propellers, outer arms [1]
# Thrust coefficient T / (rho n² D⁴), n in revolutions a second. Source: own choice; the presets span 0.045 to 0.201.  # noqa: E501
THRUST_NUMBER = 0.12
# ideal over actual hover power. Source: own choice; the presets span 0.32 to 0.71 [1]
FIGURE_OF_MERIT = 0.5
# Standard deviations over the value [1].
MASS_SPREAD = 0.01  # source: own choice, a kitchen scale, and batteries that are changed
# source: C_T of the presets, whose standard deviation is 0.36 of their mean; rounded up
THRUST_SPREAD = 0.4
CURVES = {"quadratic": 2, "linear": 1}  # thrust over throttle: its power
HEAD = """\
# Vehicle file of an X quadrotor, estimated from mass, wheelbase, propeller and hover throttle. Replace an estimate
# by a measured value where there is one; docs/reference/vehicle-file.md lists all fields."""  # noqa: E501
# [kg]
LIGHTEST = 0.005
HEAVIEST = 1000.0


@dc.dataclass(frozen=True)
class Measured:
    """What the owner measured."""

    mass: float = number(0.0, "kg", LIGHTEST, HEAVIEST)  # without payload, with battery
    # from motor to motor across the centre
    wheelbase: float = number(0.0, "m", POSITIVE, 10.0)
    propeller: float = number(0.0, "m", POSITIVE)  # diameter
    hover_throttle: float = number(0.0, "1", 0.05, 0.95)
    curve: str = word("quadratic", *CURVES)  # thrust over throttle: quadratic: it is rotor speed
    order: str = word("px4", *FIRMWARE)  # of the rotors
    props: str = word("in", *PROPS)  # the way the propellers turn at the front
    # Standard deviation over the value [1].
    mass_uncertainty: float = MASS_SPREAD
    thrust_uncertainty: float = THRUST_SPREAD

    def check(self) -> "Measured":
        """Return self after checking all values; ValueError where one is impossible or in another
        unit.
        """
        check_fields(self, "vehicle")
        if not self.propeller <= self.wheelbase:
            raise ValueError(
                f"vehicle: propeller must be a diameter up to the wheelbase, {self.wheelbase:g} m; "
                f"got {self.propeller:g}."
            )
        return self


def estimate(measured: Measured, name: str = "mine") -> Vehicle:
    """Return the vehicle of an X frame with these measures.

    Inertia: half of the mass at four rotors, half in a solid cylinder whose radius and height are half an arm, so that
    J_xx = m_r L²/2 + m_b (3 r² + h²)/12 and J_zz = m_r L² + m_b r²/2 with r = h = L/2.
    Thrust coefficient: C_T rho D⁴ / (2 pi)². Torque over thrust: `least_torque_over_thrust` over the figure of merit.
    Largest thrust: a quarter of the weight over throttle to the curve's power.
    """  # noqa: E501
    m = measured.check()
    L = 0.5 * m.wheelbase
    D = m.propeller
    arm = L / math.sqrt(2)
    at_rotors = AT_ROTORS * m.mass
    body = m.mass - at_rotors
    r = 0.5 * L
    h = 0.5 * L
    xx = 0.5 * at_rotors * L**2 + body * (3 * r**2 + h**2) / 12
    zz = at_rotors * L**2 + 0.5 * body * r**2
    thrust = THRUST_NUMBER * AIR * D**4 / (2 * math.pi) ** 2
    lever = least_torque_over_thrust(THRUST_NUMBER, D) / FIGURE_OF_MERIT
    values = {
        "mass": m.mass,
        "inertia": [[_digits(xx), 0.0, 0.0], [0.0, _digits(xx), 0.0], [0.0, 0.0, _digits(zz)]],
        "rotor_positions": [
            [_digits(x * arm), _digits(y * arm), 0.0] for x, y in FIRMWARE[m.order].positions
        ],
        "rotor_directions": directions_of(FIRMWARE[m.order].positions, m.props),
        "thrust_coefficient": _digits(thrust),
        "torque_coefficient": _digits(lever * thrust),
        "rotor_radius": _digits(0.5 * D),
        "max_rotor_thrust": _digits(0.25 * m.mass * GRAVITY / m.hover_throttle ** CURVES[m.curve]),
        "mass_uncertainty": m.mass_uncertainty,
        "thrust_uncertainty": m.thrust_uncertainty,
        "sources": _sources(m, lever),
    }
    return Vehicle(name=name, gravity=GRAVITY, **values).check()  # type: ignore[arg-type]


def _sources(m: Measured, lever: float) -> dict[str, str]:
    """Return where the values of an estimate come from; `lever` is torque over thrust [m]."""
    layout = FIRMWARE[m.order]
    power = {1: "", 2: "²"}[CURVES[m.curve]]
    corners = ", ".join(places(layout.positions))
    scale = (
        "given"
        if m.mass_uncertainty != MASS_SPREAD
        else "assumed: a kitchen scale, and another battery"
    )
    thrust = (
        "given"
        if m.thrust_uncertainty != THRUST_SPREAD
        else (
            "assumed: as C_T of the presets differs; of thrust that is logged in newtons state "
            "a smaller one"
        )
    )
    return {
        "mass": "given: with battery, without payload",
        "inertia": f"estimated: {100 * AT_ROTORS:g} % of the mass at the four rotors, the rest a "
        "solid cylinder whose radius and height are half an arm",
        "rotor_positions": f"wheelbase of {m.wheelbase:g} m, in the order of {layout.source}: "
        f"{corners}, which is that "
        "of the rotor columns of a log; the middle is taken as the centre of mass",
        "rotor_directions": f"{m.props}wards at the front; 1 turns clockwise, seen from above",
        "thrust_coefficient": f"estimated: C_T = {THRUST_NUMBER:g} of a propeller of "
        f"{m.propeller:g} m in air of {AIR:g} kg/m³",
        "torque_coefficient": f"estimated: figure of merit {FIGURE_OF_MERIT:g}, momentum theory; "
        f"{lever:.3g} m times the thrust coefficient",
        "rotor_radius": "half of the propeller diameter",
        "max_rotor_thrust": "estimated: a quarter of the weight over "
        f"{m.hover_throttle:g}{power}, {m.curve} in throttle",
        "rotor_time_constant": "not estimated",
        "mass_uncertainty": scale,
        "thrust_uncertainty": thrust,
    }


def _digits(value: float) -> float:
    """Return the value with six digits, as a file holds it."""
    return float(f"{value:.6g}")
