"""Export of a vehicle with its effects to the model files of other simulators, and the account of
how each effect is carried.

SDF, of Gazebo, which Drake's parser reads too: links `quadrotor` (body axes B, origin Bo),
`rotor_1` to `rotor_4` on revolute joints, and `payload`. Forces are those of two plugins of gz-sim
7.2 (Garden) and later, which Drake ignores. MulticopterMotorModel, one a rotor: thrust
motorConstant omega² on the rotor, and torque -turningDirection momentConstant thrust about its axis
on the body; omega follows the command by a first-order lag. Hydrodynamics: force and torque at a
link's origin in its axes, X = xU u + xUabsU |u| u + … of the velocity [u, v, w] through a current;
its water and added mass are off, and it is the air. Source: sdformat.org, specification 1.9;
gz-sim, MulticopterMotorModel.cc and Hydrodynamics.{hh,cc}.

MJCF, of MuJoCo: body `quadrotor` on a free joint, with sites `rotor_1` to `rotor_4`, `origin` and
`hook`. Motors have the names of the rotors; their `ctrl` is commanded thrust [N]. The payload is a
free body on a limited spatial tendon, which pulls and never pushes. The keyframe `hover` is level
flight at rest. Drag is an actuator at `origin` whose force is -d times its own velocity, which for
a site is that along its axis in B. Source: MuJoCo's XML reference.

In both a box as wide as the rotors reach collides; body, arms, rotor discs and payload are seen.
"""

import dataclasses as dc
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined

from diagrams.exports.corrected import Corrected, corrected
from np_drake.effects.base import MassProperties, SensorEffect
from np_drake.effects.library import effects_for
from np_drake.files.file_access import write_text
from np_drake.files.yaml_file import read_yaml
from np_drake.vehicle import Vehicle
from systems.payload_config import payload_config

LEFT_OUT = "left out"
Law = Mapping[str, tuple[str, str]]  # identifier or place of an effect -> how, and in words
LAWS: dict[str, Law] = read_yaml(Path(__file__).with_name("carried.yaml"))
# SDF
ROTOR_SHARE = 1e-3  # of the vehicle's mass that a rotor link has; own choice: Gazebo needs some [1]
ROTOR_RADIUS = 0.1  # radius of that ball over the rotor's: its spin is not felt; own choice [1]
SLOWDOWN = 10.0  # of the rotors that one sees turn: gz-sim's usual value [1]
AT_ONCE = 1e-6  # time constant of a rotor without lag, which the plugin divides by [s]
# MJCF
STEP = 0.002  # of the integrator, runge_kutta4 [s]
FINEST_STEP = 0.0005  # for which the memory of delayed commands suffices [s]
LIMIT = (0.004, 1.0)  # of the tether: time constant [s], damping ratio [1]; stretches by 0.01 mm
# shape
# sizes over the arm's length, as in our replay; own choice [1]
BODY = 0.5
ARM = 0.07
DISC = 0.04
HEIGHT = 0.2  # of body and box over the arm's length; own choice: no vehicle file tells it [1]
# red, green, blue, opacity
DARK = (0.2, 0.2, 0.22, 1.0)
PALE = (0.6, 0.6, 0.6, 0.6)
SHAPE = "approximate; a box as wide as the rotors reach collides, body, arms and discs are seen"


@dc.dataclass(frozen=True)
class Carried:
    """One line of the account.

    identifier: of the effect, or `gravity`. how: exact, approximate or left out. note: by what, or
    why not.
    """

    identifier: str
    how: str
    note: str


def how_carried(effect: Any, law: Law) -> tuple[str, str]:
    """Return how a format carries an effect, and in words."""
    for known in (effect.identifier, getattr(effect, "place", "")):
        if known in law:
            return law[known][0], law[known][1]
    sensor = hasattr(effect, "measure")
    why = "an error of the sensors, not of the motion" if sensor else "this export does not know it"
    return LEFT_OUT, why


def carried(effects: Iterable[Any], law: Law) -> list[Carried]:
    """Return a line for every effect, in the given order: none is left out in silence."""
    return [Carried(effect.identifier, *how_carried(effect, law)) for effect in effects]


def not_carried(vehicle: Vehicle) -> list[Carried]:
    """Return a line for every part of a vehicle file that it states and no format holds."""
    parts = (
        ("throttle", vehicle.throttle, "the commands are thrust or rotor speed"),
        ("rate_loop", vehicle.rate_loop, "the file has no autopilot"),
        ("calibration.imu_position", vehicle.calibration.imu_position, "the file has no sensors"),
    )
    return [Carried(name, LEFT_OUT, why) for name, value, why in parts if value is not None]


@dc.dataclass(frozen=True)
class Box:
    """Box in body axes B: centre (3,) and size (3,) [m], turned about z by `yaw` [rad]."""

    name: str
    center: np.ndarray
    size: np.ndarray
    yaw: float = 0.0

    @property
    def quaternion(self) -> list[float]:
        """Attitude in B."""
        return [np.cos(0.5 * self.yaw), 0, 0, np.sin(0.5 * self.yaw)]


def hull(vehicle: Vehicle) -> Box:
    """Return the box that collides: as wide as the rotor discs reach, as high as the body."""
    p = vehicle.rotor_positions_B
    half = 0.5 * HEIGHT * _arm(vehicle)
    lower = p.min(axis=0) - vehicle.rotor_radius
    upper = p.max(axis=0) + vehicle.rotor_radius
    lower[2], upper[2] = min(p[:, 2].min(), 0.0) - half, max(p[:, 2].max(), 0.0) + half
    return Box("hull", 0.5 * (lower + upper), upper - lower)


def seen(vehicle: Vehicle) -> list[Box]:
    """Return body and arms as boxes that are seen."""
    size = _arm(vehicle)
    boxes = [Box("body", np.zeros(3), size * np.array([BODY, BODY, HEIGHT]))]
    for i, p in enumerate(vehicle.rotor_positions_B):
        beam = np.array([np.hypot(p[0], p[1]), ARM * size, ARM * size])
        boxes.append(Box(f"arm_{i + 1}", p * [0.5, 0.5, 1.0], beam, float(np.arctan2(p[1], p[0]))))
    return boxes


def _arm(vehicle: Vehicle) -> float:
    """Return the mean distance of the rotors from Bo [m]."""
    return float(np.linalg.norm(vehicle.rotor_positions_B, axis=1).mean())


def write_sdf(vehicle: Vehicle, effects: Sequence[Any], path: str | Path) -> list[Carried]:
    """Write an SDF model of the vehicle with its effects, and return how each is carried.

    Commands are rotor speeds [rad/s] on the topic `/<model>/command/motor_speed`
    (gz.msgs.Actuators).

    Args:
        effects: objects of `np_drake.effects`.
    Raises: ValueError: as `corrected`, or if the rotor links have more inertia than the vehicle.
    """
    c = corrected(vehicle, effects)
    turning = c.rotor_inertia > 0
    rotor_mass = ROTOR_SHARE * vehicle.mass
    ball = 0.4 * rotor_mass * (ROTOR_RADIUS * vehicle.rotor_radius) ** 2
    flat = c.rotor_inertia * np.array([0.51, 0.51, 1.0])  # nearly a disc
    rotor_J = np.diag(flat if turning else np.full(3, ball))
    # Where thrust has the roll and pitch torque after `torque_share`.
    share = np.array([c.torque_share[1], c.torque_share[0], 1.0])
    positions = vehicle.rotor_positions_B * share
    air = {f"{x}{u}": -d for x, u, d in zip("xyz", "UVW", c.drag_in_hover, strict=True)}
    air |= {f"{x}{u}abs{u}": -q for x, u, q in zip("xyz", "UVW", c.quadratic, strict=True)}
    air |= {"zUU": c.lift, "zVV": c.lift, "kV": c.flapping, "mU": -c.flapping}
    damping = payload_config(c.payload).air_damping * payload_config(c.payload).mass
    _write(
        path,
        "model.sdf.j2",
        c,
        body=_without_rotors(c.mass, positions, rotor_mass, rotor_J),
        rotor_positions=positions,
        rotor_mass=rotor_mass,
        rotor_J=rotor_J,
        motor_constants=vehicle.thrust_coefficient * c.scale * c.rotor_share,
        max_speed=np.sqrt(vehicle.max_rotor_thrust / vehicle.thrust_coefficient),
        time_constants=[max(lag, AT_ONCE) for lag in (c.time_constant, c.time_constant_down)],
        slowdown=1.0 if turning else SLOWDOWN,
        body_air={name: value for name, value in air.items() if value},
        payload_air=dict.fromkeys(("xU", "yV", "zW"), -damping) if damping else {},
    )
    none = {"rotor_gyroscopic": (LEFT_OUT, "an inertia that is not positive is no link's")}
    world = f"a world's, not a model's: set {vehicle.gravity:g} m/s² there"
    law = LAWS["sdf"] if turning else {**LAWS["sdf"], **none}
    return [*carried(effects, law), Carried("gravity", LEFT_OUT, world)]


def _without_rotors(
    total: MassProperties, positions: np.ndarray, rotor_mass: float, rotor_J: np.ndarray
) -> MassProperties:
    """Return what remains of a vehicle without its rotor links, at positions (4, 3) [m]."""
    mass = total.mass - 4 * rotor_mass
    p = (total.mass * total.p_BoBcm_B - rotor_mass * positions.sum(axis=0)) / mass
    J = total.J + _steiner(total.mass, total.p_BoBcm_B) - _steiner(mass, p)
    J = J - sum(rotor_J + _steiner(rotor_mass, p_i) for p_i in positions)
    rest = MassProperties(mass, p, J)
    if not rest.rigid:
        raise ValueError(
            "write_sdf: the rotor links must leave a rigid body; they take "
            f"{4 * rotor_mass:g} kg and {4 * rotor_J[2, 2]:g} kg·m² from {total.mass:g} kg and "
            f"{total.J.diagonal()} kg·m²."
        )
    return rest


def _steiner(mass: float, p: np.ndarray) -> np.ndarray:
    """Return the inertia (3, 3) of a point mass at p (3,) about the origin [kg·m²]."""
    return mass * (p @ p * np.eye(3) - np.outer(p, p))


def write_mujoco(vehicle: Vehicle, effects: Sequence[Any], path: str | Path) -> list[Carried]:
    """Write an MJCF model of the vehicle with its effects, and return how each is carried.

    Args:
        effects: objects of `np_drake.effects`.
    Raises: ValueError: as `corrected`.
    """
    c = corrected(vehicle, effects)
    roll, pitch, yaw = c.torque_share
    drag = zip("xyz", c.drag_in_hover, np.eye(3), strict=True)
    rotors = zip(vehicle.rotor_positions, vehicle.rotor_directions, strict=True)
    _write(
        path,
        "model.mujoco.j2",
        c,
        step=STEP,
        limit=LIMIT,
        samples=int(np.ceil(c.dead_time / FINEST_STEP)) + 2,
        gears=[
            [0, 0, 1, (roll - 1) * p[1], (1 - pitch) * p[0], yaw * c.kappa * turn]
            for p, turn in rotors
        ],
        drags=[(axis, d, gear) for axis, d, gear in drag if d],
    )
    return carried(effects, LAWS["mujoco"])


def _write(path: str | Path, template: str, c: Corrected, **values: Any) -> None:
    """Write a model file, whole or not at all."""
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_digits,
    )
    hung = payload_config(c.payload)
    vehicle = c.vehicle
    text = Path(__file__).with_name(template).read_text("utf-8")
    made = environment.from_string(text).render(
        values,
        c=c,
        name=re.sub(r"[^A-Za-z0-9]+", "_", vehicle.name).strip("_") or "vehicle",
        hull=hull(vehicle),
        seen=seen(vehicle),
        thickness=DISC * _arm(vehicle),
        dark=DARK,
        pale=PALE,
        hung=hung,
        payload_place=np.array(hung.hook) - [0, 0, hung.length],
        payload_J=0.4 * hung.mass * hung.radius**2 * np.eye(3),
    )
    write_text(path, re.sub(r"\n\s*\n", "\n", made) + "\n")


def _digits(value: Any) -> Any:
    """Return a number, or numbers separated by blanks, with all their digits; text as it is."""
    if isinstance(value, str):
        return value
    return " ".join(f"{float(x) + 0.0:.15g}" for x in np.ravel(value))


@dc.dataclass(frozen=True)
class Format:
    """A format of export."""

    title: str
    write: Callable[[Vehicle, Sequence[Any], Path], list[Carried]]


FORMATS = {"sdf": Format("SDF", write_sdf), "mujoco": Format("MuJoCo", write_mujoco)}


def coverage_markdown() -> str:
    """Return the table effect x format in Markdown, as docs/guide/export.md shows it: exact,
    approximate or left out.

    Sensor errors, which every format leaves out, have no row.
    """
    lines = [f"| effect | {' | '.join(form.title for form in FORMATS.values())} |"]
    lines += ["|---" * (1 + len(FORMATS)) + "|"]
    for identifier, effect in effects_for("rotor_speed", neighbours=True).items():
        if not issubclass(effect, SensorEffect):
            ways = [how_carried(effect, LAWS[name])[0] for name in FORMATS]
            lines.append(f"| `{identifier}` | {' | '.join(ways)} |")
    return "\n".join(lines)
