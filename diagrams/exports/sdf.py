"""Export to SDF, the model format of Gazebo, which Drake's parser reads too.

Links `quadrotor` (body axes B, origin Bo), `rotor_1` to `rotor_4` on revolute joints, and
`payload`. Forces are those of two plugins of gz-sim 7.2 (Garden) and later, which Drake ignores:
    MulticopterMotorModel, one a rotor: thrust motorConstant omega² on the rotor, and torque
    -turningDirection
        momentConstant thrust about its axis on the body; omega follows the command by a first-order
        lag.
    Hydrodynamics: force and torque at a link's origin in its axes, linear and quadratic in the
        velocity [u, v, w]
        through a current: X = xU u + xUabsU |u| u + …; its water and added mass are off. Here it is
            the air.
A box as wide as the rotors reach collides; body, arms, rotor discs and payload are seen.
Source: sdformat.org, specification 1.9; gz-sim, MulticopterMotorModel.cc and Hydrodynamics.{hh,cc}.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.exports.carried import APPROXIMATE, EXACT, LEFT_OUT, Carried, Law, carried
from diagrams.exports.corrected import Corrected, corrected
from diagrams.exports.shapes import DARK, PALE, Box, disc, hull, seen
from diagrams.exports.xml_file import Element, plain_name, put, write_xml
from np_drake.vehicle import Vehicle
from systems.payload_config import payload_config

ROTOR_SHARE = 1e-3  # of the vehicle's mass that a rotor link has; own choice: Gazebo needs some [1]
ROTOR_RADIUS = 0.1  # radius of that ball over the rotor's: its spin is not felt; own choice [1]
SLOWDOWN = 10.0  # of the rotors that one sees turn: gz-sim's usual value [1]
AT_ONCE = 1e-6  # time constant of a rotor without lag, which the plugin divides by [s]
VERSION = "1.9"
_AIR = "in a Hydrodynamics plugin"

LAW: Law = {
    "mass": (EXACT, "in the inertial elements"),
    "suspended_payload": (
        APPROXIMATE,
        "a rod on a ball joint, which pushes too; air damping exact",
    ),
    "thrust_scale": (EXACT, "in motorConstant"),
    "thrust_drift": (APPROXIMATE, "its start, in motorConstant; the rate is left out"),
    "weak_rotor": (EXACT, "in the rotor's motorConstant"),
    "motor_lag": (EXACT, "timeConstantUp and timeConstantDown"),
    "uneven_lag": (EXACT, "timeConstantUp and timeConstantDown"),
    "command_delay": (LEFT_OUT, "the motor model has no dead time"),
    "linear_drag": (APPROXIMATE, f"{_AIR}, at the rotor speed that hovers"),
    "quadratic_drag": (EXACT, _AIR),
    "blade_flapping": (EXACT, _AIR),
    "translational_lift": (EXACT, _AIR),
    "rotor_inflow": (APPROXIMATE, f"{_AIR}: its slope in climb about hover"),
    "constant_wind": (EXACT, "current of the Hydrodynamics plugin"),
    "gusty_wind": (APPROXIMATE, "its mean, current of the Hydrodynamics plugin"),
    "ground_effect": (LEFT_OUT, "no plugin has thrust over height"),
    "downwash": (LEFT_OUT, "the file has no neighbour"),
    "rotor_gyroscopic": (EXACT, "inertia of the rotor links, which turn at rotor speed"),
    "mixer_gain": (EXACT, "in the places of the rotors and momentConstant"),
}


def write_sdf(vehicle: Vehicle, effects: Sequence[Any], path: str | Path) -> list[Carried]:
    """Write an SDF model of the vehicle with its effects, and return how each is carried.

    Commands are rotor speeds [rad/s] on the topic `/<model>/command/motor_speed`
    (gz.msgs.Actuators).

    Args:
        effects: objects of `np_drake.effects`.
    Raises: ValueError: as `corrected`, or if the rotor links have more inertia than the vehicle.
    """
    c = corrected(vehicle, effects)
    root = Element("sdf", version=VERSION)
    model = put(root, "model", name=plain_name(vehicle.name))
    _body(model, c)
    for i in range(4):
        _rotor(model, c, i)
    if c.payload is not None:
        _payload(model, c)
    for i in range(4):
        _motor(model, c, i)
    _air(model, c)
    comment = (
        "np_drake export: motorConstant [N/(rad/s)^2], momentConstant [m]; commands are "
        "rotor speeds [rad/s]"
    )
    write_xml(root, path, comment)
    return _account(c, effects)


def _account(c: Corrected, effects: Sequence[Any]) -> list[Carried]:
    law = dict(LAW)
    if c.rotor_inertia <= 0:
        law["rotor_gyroscopic"] = (LEFT_OUT, "an inertia that is not positive is no link's")
    world = f"a world's, not a model's: set {c.vehicle.gravity:g} m/s² there"
    return [*carried(effects, law), Carried("gravity", LEFT_OUT, world)]


def _rotor_inertia(c: Corrected) -> tuple[float, np.ndarray]:
    """Return mass [kg] and moments of inertia (3,) about its centre [kg·m²] of a rotor link."""
    mass = ROTOR_SHARE * c.vehicle.mass
    if c.rotor_inertia > 0:
        return mass, c.rotor_inertia * np.array([0.51, 0.51, 1.0])  # nearly a flat disc
    return mass, np.full(3, 0.4 * mass * (ROTOR_RADIUS * c.vehicle.rotor_radius) ** 2)


def _steiner(mass: float, p: np.ndarray) -> np.ndarray:
    """Return the inertia (3, 3) of a point mass at p (3,) about the origin [kg·m²]."""
    return mass * (p @ p * np.eye(3) - np.outer(p, p))


def _body(model: Element, c: Corrected) -> None:
    """Add the link `quadrotor`: what remains of the vehicle without the rotor links."""
    m_r, I_r = _rotor_inertia(c)
    p = c.rotor_positions
    mass = c.mass.mass - 4 * m_r
    p_cm = (c.mass.mass * c.mass.p_BoBcm_B - m_r * p.sum(axis=0)) / mass
    J = c.mass.J + _steiner(c.mass.mass, c.mass.p_BoBcm_B) - _steiner(mass, p_cm)
    J = J - sum(np.diag(I_r) + _steiner(m_r, p_i) for p_i in p)
    moments = np.linalg.eigvalsh(J)
    if not (mass > 0 and moments[0] > 0 and moments[2] <= moments[:2].sum()):
        raise ValueError(
            "write_sdf: the rotor links must leave a rigid body; they take "
            f"{4 * m_r:g} kg and {4 * I_r[2]:g} kg·m² from {c.mass.mass:g} kg and "
            f"{c.mass.J.diagonal()} kg·m²."
        )
    link = put(model, "link", name="quadrotor")
    _inertial(link, mass, p_cm, J)
    _box(put(link, "collision", name="hull"), hull(c.vehicle))
    for part in seen(c.vehicle):
        visual = put(link, "visual", name=part.name)
        _box(visual, part)
        _colour(visual, DARK)


def _box(element: Element, box: Box) -> None:
    put(element, "pose", [*box.center, 0, 0, box.yaw])
    put(put(put(element, "geometry"), "box"), "size", box.size)


def _colour(visual: Element, colour: Sequence[float]) -> None:
    material = put(visual, "material")
    put(material, "ambient", colour)
    put(material, "diffuse", colour)


def _inertial(link: Element, mass: float, p_cm: np.ndarray, J: np.ndarray) -> None:
    inertial = put(link, "inertial")
    put(inertial, "pose", [*p_cm, 0, 0, 0])
    put(inertial, "mass", mass)
    inertia = put(inertial, "inertia")
    for i in range(3):
        for j in range(i, 3):
            put(inertia, f"i{'xyz'[i]}{'xyz'[j]}", J[i, j])


def _rotor(model: Element, c: Corrected, i: int) -> None:
    """Add rotor i (from 0) as a link on a revolute joint about body z, for the motor plugin to
    turn.
    """
    mass, moments = _rotor_inertia(c)
    name = f"rotor_{i + 1}"
    link = put(model, "link", name=name)
    put(link, "pose", [*c.rotor_positions[i], 0, 0, 0], relative_to="quadrotor")
    _inertial(link, mass, np.zeros(3), np.diag(moments))
    radius, thickness = disc(c.vehicle)
    visual = put(link, "visual", name="disc")
    shape = put(put(visual, "geometry"), "cylinder")
    put(shape, "radius", radius)
    put(shape, "length", thickness)
    _colour(visual, PALE)
    joint = put(model, "joint", name=f"{name}_joint", type="revolute")
    put(joint, "parent", "quadrotor")
    put(joint, "child", name)
    axis = put(joint, "axis")
    put(axis, "xyz", [0, 0, 1])
    limit = put(axis, "limit")
    put(limit, "lower", -1e16)
    put(limit, "upper", 1e16)


def _payload(model: Element, c: Corrected) -> None:
    """Add the payload: a sphere on a massless rod, whose upper end is the hook."""
    assert c.payload is not None  # narrows the type
    config = payload_config(c.payload)
    link = put(model, "link", name="payload")
    place = np.array(config.hook) - [0, 0, config.length]
    put(link, "pose", [*place, 0, 0, 0], relative_to="quadrotor")
    moment = 0.4 * config.mass * config.radius**2
    _inertial(link, config.mass, np.zeros(3), np.diag([moment] * 3))
    for kind in ("collision", "visual"):
        shape = put(link, kind, name="payload")
        put(put(put(shape, "geometry"), "sphere"), "radius", config.radius)
    joint = put(model, "joint", name="tether", type="ball")
    put(joint, "pose", [0, 0, config.length, 0, 0, 0])
    put(joint, "parent", "quadrotor")
    put(joint, "child", "payload")
    if config.air_damping:
        drag = -config.air_damping * config.mass
        _hydrodynamics(model, "payload", {"xU": drag, "yV": drag, "zW": drag}, np.zeros(3))


def _motor(model: Element, c: Corrected, i: int) -> None:
    """Add the motor plugin of rotor i (from 0)."""
    plugin = _plugin(model, "gz-sim-multicopter-motor-model-system", "MulticopterMotorModel")
    turns = "cw" if c.vehicle.rotor_directions[i] > 0 else "ccw"  # against its reaction torque
    for tag, value in {
        "robotNamespace": plain_name(c.vehicle.name),
        "jointName": f"rotor_{i + 1}_joint",
        "linkName": f"rotor_{i + 1}",
        "turningDirection": turns,
        "timeConstantUp": max(c.time_constant, AT_ONCE),
        "timeConstantDown": max(c.time_constant_down, AT_ONCE),
        "maxRotVelocity": c.max_speed,
        "motorConstant": c.vehicle.thrust_coefficient * c.scale * c.rotor_share[i],
        "momentConstant": c.kappa * c.torque_share[2],
        "commandSubTopic": "command/motor_speed",
        "motorNumber": str(i),
        "rotorDragCoefficient": 0.0,  # drag is the Hydrodynamics plugin's
        "rollingMomentCoefficient": 0.0,
        "rotorVelocitySlowdownSim": 1.0 if c.rotor_inertia > 0 else SLOWDOWN,
        "motorType": "velocity",
    }.items():
        put(plugin, tag, value)


def _air(model: Element, c: Corrected) -> None:
    """Add drag, lift and flapping moment of the body, where there are any."""
    terms = {f"{x}{u}": -d for x, u, d in zip("xyz", "UVW", c.drag_in_hover, strict=True)}
    terms |= {f"{x}{u}abs{u}": -q for x, u, q in zip("xyz", "UVW", c.quadratic, strict=True)}
    terms |= {"zUU": c.lift, "zVV": c.lift, "kV": c.flapping, "mU": -c.flapping}
    _hydrodynamics(model, "quadrotor", terms, c.wind)


def _hydrodynamics(model: Element, link: str, terms: dict[str, float], wind: np.ndarray) -> None:
    """Add the air of a link, where a term is not zero.

    Args:
        terms: by the plugin's names [N·s/m, N·s²/m², N·m·s/m].
        wind: (3,) in W [m/s].
    """
    there = {name: value for name, value in terms.items() if value}
    if not there:
        return
    plugin = _plugin(model, "gz-sim-hydrodynamics-system", "Hydrodynamics")
    put(plugin, "link_name", link)
    put(plugin, "namespace", f"air_of_{link}")  # no ocean's current
    put(plugin, "default_current", wind)
    put(plugin, "water_density", 0.0)
    put(plugin, "disable_added_mass", "true")
    put(plugin, "disable_coriolis", "true")
    for name, value in there.items():
        put(plugin, name, value)


def _plugin(model: Element, filename: str, name: str) -> Element:
    return put(model, "plugin", filename=filename, name=f"gz::sim::systems::{name}")
