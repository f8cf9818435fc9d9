"""Export to MJCF, the model format of MuJoCo.

Body `quadrotor` (body axes B, origin Bo) on a free joint, with sites `rotor_1` to `rotor_4`,
`origin` and `hook`. Motors have the names of the rotors; their `ctrl` is commanded thrust [N]. The
payload is a free body on a limited spatial tendon, which pulls and never pushes. The keyframe
`hover` is level flight at rest. A box as wide as the rotors reach collides (group 3, which is not
drawn); body, arms and rotor discs are seen. Drag is an actuator at `origin` whose force is -d times
its own velocity, which for a site is that along its axis in B.
Source: MuJoCo's XML reference.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.exports.carried import APPROXIMATE, EXACT, LEFT_OUT, Carried, Law, carried
from diagrams.exports.corrected import Corrected, corrected
from diagrams.exports.shapes import DARK, PALE, disc, hull, seen
from diagrams.exports.xml_file import Element, plain_name, put, write_xml
from np_drake.vehicle import Vehicle
from systems.payload_config import payload_config

STEP = 0.002  # of the integrator, runge_kutta4 [s]
FINEST_STEP = 0.0005  # for which the memory of delayed commands suffices [s]
LIMIT = (
    0.004,
    1.0,
)  # of the tether: time constant [s] and damping ratio [1]; it stretches by some 0.01 mm
_DRAG = "actuators whose force is -d times velocity"
_CROSS = "no actuator turns a velocity into a force across it"

LAW: Law = {
    "mass": (EXACT, "in the inertial element"),
    "suspended_payload": (
        EXACT,
        "a limited tendon, which may go slack; air damping in the free joint",
    ),
    "thrust_scale": (EXACT, "gain of the motors"),
    "thrust_drift": (APPROXIMATE, "its start, gain of the motors; the rate is left out"),
    "weak_rotor": (EXACT, "gain of the motor"),
    "motor_lag": (APPROXIMATE, "a first-order lag of thrust, not of rotor speed"),
    "uneven_lag": (APPROXIMATE, "the lag of a rotor that speeds up, both ways"),
    "command_delay": (
        EXACT,
        "delay of the actuators (MuJoCo 3.5 or later), whose memory starts at zero",
    ),
    "linear_drag": (APPROXIMATE, f"{_DRAG}, at the rotor speed that hovers"),
    "quadratic_drag": (LEFT_OUT, "no actuator has a force over speed squared"),
    "blade_flapping": (LEFT_OUT, _CROSS),
    "translational_lift": (LEFT_OUT, _CROSS),
    "rotor_inflow": (APPROXIMATE, f"{_DRAG}: its slope in climb about hover"),
    "constant_wind": (LEFT_OUT, "the drag actuators feel the velocity over ground"),
    "gusty_wind": (LEFT_OUT, "the drag actuators feel the velocity over ground"),
    "ground_effect": (LEFT_OUT, "no actuator has a gain over height"),
    "downwash": (LEFT_OUT, "the file has no neighbour"),
    "rotor_gyroscopic": (LEFT_OUT, "the rotors are sites, which do not turn"),
    "mixer_gain": (EXACT, "gears of the motors"),
}


def write_mujoco(vehicle: Vehicle, effects: Sequence[Any], path: str | Path) -> list[Carried]:
    """Write an MJCF model of the vehicle with its effects, and return how each is carried.

    Args:
        effects: objects of `np_drake.effects`.
    Raises: ValueError: as `corrected`.
    """
    c = corrected(vehicle, effects)
    root = Element("mujoco", model=plain_name(vehicle.name))
    put(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    put(root, "option", timestep=STEP, integrator="RK4", gravity=[0, 0, -vehicle.gravity])
    world = put(root, "worldbody")
    _body(world, c)
    if c.payload is not None:
        _payload(root, world, c)
    actuators = put(root, "actuator")
    for i in range(4):
        _motor(actuators, c, i)
    for axis, drag in zip("xyz", c.drag_in_hover, strict=True):
        if drag:
            _drag(actuators, axis, drag)
    _hover(root, c, drags=int(np.count_nonzero(c.drag_in_hover)))
    write_xml(
        root, path, "np_drake export: ctrl of rotor_1 to rotor_4 is commanded thrust [N]; SI units"
    )
    return carried(effects, LAW)


def _body(world: Element, c: Corrected) -> None:
    body = put(world, "body", name="quadrotor")
    put(body, "freejoint", name="quadrotor")
    J, m = c.mass.J, c.mass
    moments = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    put(body, "inertial", pos=m.p_BoBcm_B, mass=m.mass, fullinertia=moments)
    _shape(body, c.vehicle)
    put(body, "site", name="origin", pos=np.zeros(3))
    for i, p in enumerate(np.array(c.vehicle.rotor_positions, float)):
        put(body, "site", name=f"rotor_{i + 1}", pos=p)
    if c.payload is not None:
        put(body, "site", name="hook", pos=payload_config(c.payload).hook)


def _shape(body: Element, vehicle: Vehicle) -> None:
    """Add the box that collides, in group 3, which is not drawn, and in group 2 what is seen."""
    box = hull(vehicle)
    put(body, "geom", name=box.name, type="box", pos=box.center, size=0.5 * box.size, group=3)
    only = {"contype": 0, "conaffinity": 0, "group": 2}
    for part in seen(vehicle):
        place = {"pos": part.center, "quat": [np.cos(0.5 * part.yaw), 0, 0, np.sin(0.5 * part.yaw)]}
        put(
            body,
            "geom",
            name=part.name,
            type="box",
            size=0.5 * part.size,
            rgba=DARK,
            **place,
            **only,
        )
    radius, thickness = disc(vehicle)
    for i, p in enumerate(np.array(vehicle.rotor_positions, float)):
        size = [radius, 0.5 * thickness]
        put(
            body, "geom", name=f"disc_{i + 1}", type="cylinder", pos=p, size=size, rgba=PALE, **only
        )


def _payload(root: Element, world: Element, c: Corrected) -> None:
    """Add a free sphere and the tendon of length 0 to L between its centre and the hook."""
    config = payload_config(c.payload)
    body = put(world, "body", name="payload", pos=np.array(config.hook) - [0, 0, config.length])
    # The damping brakes the sphere's turning too, which nothing feels.
    put(body, "joint", name="payload", type="free", damping=config.air_damping * config.mass)
    moment = 0.4 * config.mass * config.radius**2
    put(body, "inertial", pos=np.zeros(3), mass=config.mass, diaginertia=[moment] * 3)
    put(body, "geom", name="payload", type="sphere", size=config.radius)
    put(body, "site", name="payload", pos=np.zeros(3))
    tendon = put(
        put(root, "tendon"), "spatial", name="tether", range=[0, config.length], solreflimit=LIMIT
    )
    put(tendon, "site", site="hook")
    put(tendon, "site", site="payload")


def _motor(actuators: Element, c: Corrected, i: int) -> None:
    """Add the motor of rotor i (from 0): gear of thrust and of torque in B, gain of thrust over
    command.
    """
    x, y, _ = c.vehicle.rotor_positions[i]
    roll, pitch, yaw = c.torque_share
    gear = [0, 0, 1, (roll - 1) * y, (1 - pitch) * x, yaw * c.kappa * c.vehicle.rotor_directions[i]]
    given: dict[str, Any] = {
        "gainprm": c.scale * c.rotor_share[i],
        "ctrlrange": [0, c.vehicle.max_rotor_thrust],
    }
    if c.time_constant > 0:
        given |= {"dyntype": "filter", "dynprm": c.time_constant}
    if c.dead_time > 0:
        given |= {"delay": c.dead_time, "nsample": int(np.ceil(c.dead_time / FINEST_STEP)) + 2}
    put(actuators, "general", name=f"rotor_{i + 1}", site=f"rotor_{i + 1}", gear=gear, **given)


def _drag(actuators: Element, axis: str, drag: float) -> None:
    gear = [float(axis == other) for other in "xyz"] + [0.0, 0.0, 0.0]
    affine = {"gainprm": 0.0, "biastype": "affine", "biasprm": [0, 0, -drag]}
    put(actuators, "general", name=f"drag_{axis}", site="origin", gear=gear, **affine)


def _hover(root: Element, c: Corrected, *, drags: int) -> None:
    """Add the keyframe `hover`: rotors that carry the weight, payload at rest below the hook."""
    pose = [0, 0, 0, 1, 0, 0, 0]
    if c.payload is not None:
        config = payload_config(c.payload)
        pose += [*(np.array(config.hook) - [0, 0, config.length]), 1, 0, 0, 0]
    command = c.hover_command
    key = put(
        put(root, "keyframe"), "key", name="hover", qpos=pose, ctrl=[*command, *np.zeros(drags)]
    )
    if c.time_constant > 0:
        key.set("act", " ".join(f"{f:.15g}" for f in command))
