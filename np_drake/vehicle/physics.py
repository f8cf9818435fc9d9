"""Bounds of physics on the figures of a vehicle file, which one in another unit leaves."""

import math
from typing import Protocol

import numpy as np

AIR = 1.225  # density at sea level, 15 °C [kg/m³]
SOUND = 340.0  # its speed of sound [m/s]
# Largest moment of inertia over mass times squared arm [1]; own choice. All mass at the rotors
# gives 1, the presets 0.3 to 0.6, a vehicle whose payload bay is as long as its arms below 2.
INERTIA = (0.005, 5.0)
# Torque over that of a rotor without loss, from which it is one [1]; own choice: 1 is the bound,
# and C_T is a guess.
EFFICIENT = 0.25
STRONGEST = 50.0  # largest thrust over weight [1]; own choice: racing quadrotors have 10 to 20


class Figures(Protocol):
    """What is checked of a `Vehicle`, in its units."""

    mass: float
    gravity: float
    inertia: list[list[float]]
    rotor_positions: list[list[float]]
    thrust_coefficient: float
    torque_coefficient: float
    rotor_radius: float
    max_rotor_thrust: float


def implausible(vehicle: Figures) -> str:
    """Return what no quadrotor can have, with the unit that was probably meant; empty: nothing."""
    return next(
        filter(None, (_inertia(vehicle), _thrust(vehicle), _tips(vehicle), _torque(vehicle))), ""
    )


def least_torque_over_thrust(number: float, diameter: float) -> float:
    """Return torque over thrust of a rotor without loss, of figure of merit 1 [m].

    Momentum theory: the power Omega Q of a propeller of disc area A that hovers at thrust T is T
    sqrt(T / (2 rho A)), hence Q / T = D sqrt(2 C_T / pi) / (2 pi).

    Args:
        number: thrust number C_T = T / (rho n² D⁴), n in revolutions a second [1].
        diameter: D of the rotor [m].
    """
    return diameter * math.sqrt(2 * number / math.pi) / (2 * math.pi)


def _inertia(v: Figures) -> str:
    arm = float(np.linalg.norm(v.rotor_positions, axis=1).max())
    unit, largest = v.mass * arm**2, float(np.linalg.eigvalsh(np.array(v.inertia, float))[-1])
    least, most = (share * unit for share in INERTIA)
    if least <= largest <= most:
        return ""
    return (
        f"inertia must be comparable with mass times squared arm, {unit:.2g} kg·m² "
        f"({least:.2g} to {most:.2g}); got "
        f"{largest:.3g}. Is it in kg·m² (1 g·mm² is 1e-9, 1 g·cm² 1e-7 kg·m²), the mass in "
        f"kg, the arm in m?"
    )


def _thrust(v: Figures) -> str:
    weight = v.mass * v.gravity
    if 4 * v.max_rotor_thrust <= STRONGEST * weight:
        return ""
    return (
        f"max_rotor_thrust must be of one rotor, in all at most {STRONGEST:g} times the "
        f"weight of {weight:.3g} N; got "
        f"{v.max_rotor_thrust:.4g} N each. Is it in N (1 gf is 0.0098 N), and the mass in kg?"
    )


def _tips(v: Figures) -> str:
    speed = math.sqrt(v.max_rotor_thrust / v.thrust_coefficient)
    tip = speed * v.rotor_radius
    unit = (
        "Is thrust_coefficient in N/(rad/s)² (1 N/rpm² is 91.2 N/(rad/s)²), and rotor_radius in m?"
    )
    named = (
        f"thrust_coefficient must give {v.max_rotor_thrust:.4g} N from a rotor of "
        f"{v.rotor_radius:.3g} m"
    )
    if tip >= SOUND:
        return (
            f"{named} below the speed of sound; got tips at {tip:.0f} m/s ({speed:.5g} "
            f"rad/s). {unit}"
        )
    # Momentum theory: the air through the disc moves at sqrt(T / (2 rho A)), which no blade's tip
    # can be slower than.
    induced = math.sqrt(v.max_rotor_thrust / (2 * AIR * math.pi * v.rotor_radius**2))
    if tip < induced:
        return (
            f"{named} with tips faster than its air, {induced:.3g} m/s; got {tip:.2g} m/s. {unit}"
        )
    return ""


def _torque(v: Figures) -> str:
    lever, D = v.torque_coefficient / v.thrust_coefficient, 2 * v.rotor_radius
    ideal = least_torque_over_thrust(v.thrust_coefficient * (2 * math.pi) ** 2 / (AIR * D**4), D)
    if EFFICIENT * ideal <= lever <= D:
        return ""
    return (
        f"torque_coefficient over thrust_coefficient must be {EFFICIENT * ideal:.2g} to "
        f"{D:.2g} m, the rotor's "
        f"diameter; got {lever:.3g} m. Are both per (rad/s)², and rotor_radius in m?"
    )
