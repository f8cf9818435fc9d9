"""Export to RotorPy: the dictionary `quad_params` of its class Multirotor, also as JSON.

Source: rotorpy 3, rotorpy/vehicles/multirotor.py: thrust k_eta omega², torque rotor_directions k_m omega² about body z,
rotor drag -omega diag(k_d, k_d, k_z) v at every rotor, body drag -|v| diag(c_D) v, lift k_h (v_x² + v_y²) and moment
-k_flap omega (v x z) of every rotor; tau_m d omega/dt = command - omega. All places are from the centre of mass.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.exports.carried import APPROXIMATE, EXACT, LEFT_OUT, Carried, Law, carried
from diagrams.exports.corrected import Corrected, corrected
from np_drake.files.atomic_file import write_json
from np_drake.vehicle import Vehicle

GRAVITY = 9.81  # RotorPy's, which is no parameter [m/s²]
AT_ONCE = 0.001  # time constant of a rotor without lag, by which RotorPy divides [s]
_HUBS = "at the rotors, not at the origin"
_WIND = "an argument of the simulation, not a parameter: ConstantWind(x, y, z)"

LAW: Law = {
    "mass": (EXACT, "mass"),
    "inertia_error": (EXACT, "Ixx, …, Iyz"),
    "center_of_mass_offset": (EXACT, "rotor_pos; RotorPy's position is that of the centre of mass"),
    "suspended_payload": (LEFT_OUT, "RotorPy has one body"),
    "thrust_scale": (EXACT, "k_eta and k_m"),
    "thrust_drift": (APPROXIMATE, "its start, in k_eta and k_m; the rate is left out"),
    "weak_rotor": (LEFT_OUT, "k_eta is one number for all rotors"),
    "motor_lag": (EXACT, "tau_m"),
    "uneven_lag": (APPROXIMATE, "the lag of a rotor that speeds up, both ways"),
    "command_delay": (LEFT_OUT, "no parameter; hold the commands back in the controller"),
    "linear_drag": (APPROXIMATE, f"k_d, the mean of x and y, and k_z, {_HUBS}"),
    "quadratic_drag": (APPROXIMATE, "c_Dx, c_Dy, c_Dz, with |v| in place of each axis' own"),
    "blade_flapping": (APPROXIMATE, f"k_flap, which grows with rotor speed, {_HUBS}"),
    "translational_lift": (APPROXIMATE, f"k_h, {_HUBS}"),
    "rotor_inflow": (APPROXIMATE, "k_z: its slope in climb about hover"),
    "constant_wind": (LEFT_OUT, _WIND),
    "gusty_wind": (LEFT_OUT, _WIND),
    "ground_effect": (LEFT_OUT, "no parameter"),
    "downwash": (LEFT_OUT, "the file has no neighbour"),
    "rotor_gyroscopic": (LEFT_OUT, "no parameter"),
    "mixer_gain": (EXACT, "in rotor_pos and k_m"),
}


def rotorpy_parameters(vehicle: Vehicle, effects: Sequence[Any]) -> dict[str, Any]:
    """Return `quad_params` of the vehicle with its effects [SI]; arrays where RotorPy wants them.

    `rI`, the place of its IMU, is Bo. Weak rotors have no part in it.

    Args:
        vehicle: nominal vehicle.
        effects: objects of `np_drake.effects`.
    Raises: ValueError: as `corrected`.
    """
    c = corrected(vehicle, effects)
    J, p_cm = c.mass.J, c.mass.p_BoBcm_B
    k_eta = c.scale * vehicle.thrust_coefficient
    return {
        "mass": c.mass.mass,
        **{f"I{'xyz'[i]}{'xyz'[j]}": float(J[i, j]) for i in range(3) for j in range(i, 3)},
        "num_rotors": 4,
        "rotor_radius": vehicle.rotor_radius,
        "rotor_pos": {f"r{i + 1}": p - p_cm for i, p in enumerate(c.rotor_positions)},
        "rotor_directions": np.array(vehicle.rotor_directions),
        "rI": -p_cm,
        **{f"c_D{axis}": float(q) for axis, q in zip("xyz", c.quadratic, strict=True)},
        "k_eta": k_eta,
        "k_m": k_eta * c.kappa * float(c.torque_share[2]),
        **_in_the_flow(c),
        "tau_m": max(c.time_constant, AT_ONCE),
        "rotor_speed_min": 0.0,
        "rotor_speed_max": c.max_speed,
        "motor_noise_std": 0.0,
    }


def _in_the_flow(c: Corrected) -> dict[str, float]:
    """Return the coefficients of rotors in a flow.

    Drag: d s v with s = sum sqrt(f_i) / (4 sqrt(f_hover)) is k_d sum(omega_i) v, since f_i = k_eta omega_i².
    """
    k_eta = c.scale * c.vehicle.thrust_coefficient
    nominal = c.vehicle.mass * c.vehicle.gravity / 4
    over_speed = np.sqrt(k_eta / nominal) / 4  # of s over the sum of rotor speeds [s/rad]
    flapping_speed = 4 * np.sqrt(c.hover_thrust / k_eta)  # sum of rotor speeds in hover [rad/s]
    return {
        "k_d": float(over_speed * c.linear[:2].mean()),
        "k_z": float(over_speed * c.linear[2] + 0.5 * c.inflow * np.sqrt(c.scale)),
        "k_h": c.lift / 4,
        "k_flap": float(-c.flapping / flapping_speed),
    }


def write_rotorpy(vehicle: Vehicle, effects: Sequence[Any], path: str | Path) -> list[Carried]:
    """Write `quad_params` as JSON, and return how each effect is carried.

    Lists take the place of arrays; RotorPy wants `rotor_directions` and `rotor_pos` as arrays (docs/guide/export.md).

    Args:
        vehicle: nominal vehicle.
        effects: objects of `np_drake.effects`.
        path: of the file.
    Raises: ValueError: as `corrected`.
    """
    write_json(path, rotorpy_parameters(vehicle, effects))
    account = carried(effects, LAW)
    if vehicle.gravity != GRAVITY:
        account.append(Carried("gravity", LEFT_OUT, f"RotorPy's is {GRAVITY:g}, not {vehicle.gravity:g} m/s²"))
    return account
