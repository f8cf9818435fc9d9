"""Effects that the library does not have: what a diagnosis should call unknown.

Source of each law: own choice, of what vehicles are known to meet.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from diagrams.evidence.challenge.plans import level_direction
from np_drake.effects.base import (
    ActuatorEffect,
    Effect,
    Motion,
    WrenchEffect,
    chi_from_body,
    direction,
    log_uniform,
    signed,
)
from np_drake.rigid_body import P, V, W
from np_drake.vehicle import Vehicle

UP = np.array([0.0, 0.0, 1.0])


class OutOfLibrary(Effect):
    """An effect by a law of this file, named as the law; its `values` are the sizes that this
    takes.
    """

    parameters = ()

    def __init__(self, law: Callable, **sizes: Any):
        self.identifier = law.__name__  # type: ignore[misc]
        self._law = law
        self._sizes = sizes

    @property
    def values(self) -> dict[str, Any]:
        """Sizes of the law by name."""
        return self._sizes


class OutOfLibraryWrench(OutOfLibrary, WrenchEffect):
    """An effect that adds a wrench: law(vehicle, motion, ...) -> chi (..., 6) [N, N·m]."""

    def wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return chi (..., 6) [N, N·m]."""
        return self._law(vehicle, motion, **self._sizes)


class OutOfLibraryActuator(OutOfLibrary, ActuatorEffect):
    """An effect between command and thrust: law(vehicle, command, state, ...) -> the state at rest
    under the command, the rate of the state, and the thrust that rotors give; state None: at rest.
    """

    def __init__(self, law: Callable, **sizes: Any):
        super().__init__(law, **sizes)
        self.state_size = self.state_at(Vehicle(), np.ones(4)).shape[-1]  # type: ignore[misc]

    def state_at(self, vehicle, thrust):
        """Return the state at rest (..., state_size)."""
        return self._law(vehicle, np.asarray(thrust, float), None, **self._sizes)[0]

    def state_rate(self, vehicle, state, command):
        """Return the rate of the state (..., state_size) [state/s]."""
        return self._law(vehicle, command, state, **self._sizes)[1]

    def thrust(self, vehicle, state, command, t=0.0):
        """Return what the rotors give (..., 4) [N]."""
        return self._law(vehicle, command, state, **self._sizes)[2]


def _weight(vehicle: Vehicle) -> float:
    """Return the weight, of which a rotor carries a quarter in hover [N]."""
    return vehicle.mass * vehicle.gravity


def _force(f_W: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force at Bo (..., 3) in W [N]."""
    return np.concatenate([f_W, np.zeros_like(f_W)], axis=-1)


def _torque(tau_B: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a torque (..., 3) in B [N·m]."""
    return np.concatenate([np.zeros_like(tau_B), tau_B], axis=-1)


def _lift(motion: Motion, force: np.ndarray) -> np.ndarray:
    """Return chi (..., 6) of a force (...,) along body z [N]."""
    return chi_from_body(motion, force[..., None] * UP)


# Moving air, ground and walls.


def fan_jet(vehicle, motion, force, center, size):
    """A fan's jet at one place of the room: f = force exp(-|p - center|² / 2 size²) in W [N, m]."""
    away = np.sum((motion.x[..., P] - center) ** 2, axis=-1)
    return _force(np.exp(-0.5 * away / size**2)[..., None] * force)


def wind_shear(vehicle, motion, c, height, course):
    """Wind shear, as far as a drag feels it: f = c (z - height) towards `course` in W [N/m, m]."""
    push = c * (motion.x[..., P][..., 2] - height)
    return _force(push[..., None] * np.array([np.cos(course), np.sin(course), 0.0]))


def doorway_draft(vehicle, motion, force, normal, from_origin, edge):
    """A draft on one side of a plane: f = force (1 + tanh((normal · p - from_origin) / edge)) / 2
    in W [N, m].
    """
    inside = motion.x[..., P] @ np.array(normal) - from_origin
    return _force((0.5 * (1.0 + np.tanh(inside / edge)))[..., None] * force)


def wall_suction(vehicle, motion, strength, reach, normal, from_origin):
    """Suction towards a wall at distance d [m]: f = strength thrust exp(-d / reach) normal.

    Points p of the wall have normal · p = from_origin.
    """
    d = np.maximum(from_origin - motion.x[..., P] @ np.array(normal), 0.0)
    pull = strength * motion.rotor_thrust.sum(axis=-1) * np.exp(-d / reach)
    return _force(pull[..., None] * np.array(normal))


# Aerodynamics of airframe and rotors.


def rotational_damping(vehicle, motion, c):
    """Quadratic damping of the body rates, axis by axis: tau = -c |w| w [N·m·s²/rad²]."""
    w = motion.x[..., W]
    return _torque(-c * np.abs(w) * w)


def vortex_ring(vehicle, motion, loss, speed, width):
    """The rotors lose `loss` [1] of their thrust in a descent at about `speed` [m/s]."""
    off = (motion.x[..., V][..., 2] + speed) / width
    return _lift(motion, -loss * motion.rotor_thrust.sum(axis=-1) * np.exp(-(off**2)))


def odd_propeller(vehicle, motion, rotor, c):
    """One propeller of another make: its side force is not balanced by those that turn the other
    way.

    f = c sqrt(f_i / h) (z x v) in B at the rotor (0 to 3) [N·s/m], v of Bo through the air, h the
    thrust in hover; tau = place x f.
    """
    over_hover = motion.rotor_thrust[..., rotor] / (_weight(vehicle) / 4)
    turning = np.sqrt(np.maximum(over_hover, 0.0))  # speed of the rotor over that in hover
    f_B = c * turning[..., None] * np.cross([0.0, 0.0, 1.0], motion.air_B)
    return chi_from_body(motion, f_B, np.cross(vehicle.rotor_positions[rotor], f_B))


def rotor_saturation(vehicle, motion, limit):
    """No rotor gives more than `limit` [N]."""
    lost = -np.maximum(motion.rotor_thrust - limit, 0.0) @ vehicle.mixer.T
    return _lift(motion, lost[..., 0]) + _torque(lost[..., 1:])


# Tethers, cables, friction and turning masses.


def periodic_force(vehicle, motion, force, frequency, phase):
    """A periodic disturbance: f = force sin(2 pi frequency t + phase) in W [N, Hz, rad]."""
    wave = np.sin(2 * np.pi * frequency * np.asarray(motion.t) + phase)
    return _force(np.broadcast_to(wave[..., None] * force, (*motion.x.shape[:-1], 3)))


def ground_tether(vehicle, motion, stiffness, slack, anchor):
    """A rubber band from `anchor` to Bo: stiffness [N/m] times what is beyond `slack` [m], and it
    only pulls.
    """
    r = motion.x[..., P] - anchor
    span = np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
    return _force(-stiffness * np.maximum(span - slack, 0.0) * r / span)


def winch_tether(vehicle, motion, tension, friction, creep, anchor):
    """A winch keeps a tether taut: f = -tension (1 + friction tanh(v · n / creep)) n in W [N, m/s].

    n is the direction from `anchor` to Bo. The drum rubs, so it pulls harder while the tether runs
    out than while it is wound in.
    """
    r = motion.x[..., P] - anchor
    n = r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-6)
    runs_out = np.sum(motion.x[..., V] * n, axis=-1, keepdims=True)
    return _force(-tension * (1.0 + friction * np.tanh(runs_out / creep)) * n)


def rubbing_line(vehicle, motion, force, creep):
    """Dry friction of a safety line where it is led round: f = -force tanh(|v| / creep) v / |v|
    in W [N, m/s].
    """
    v = motion.x[..., V]
    speed = np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
    return _force(-force * np.tanh(speed / creep) * v / speed)


def twisted_cable(vehicle, motion, k):
    """A power cable that was laid out straight twists back: tau = -k sin(heading) about the
    vertical [N·m].
    """
    R = motion.R_WB
    heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    return _torque(-k * np.sin(heading)[..., None] * R[..., 2, :])


def sticking_axis(vehicle, motion, axis, drag, torque, period, share):
    """An axis (0 to 2) that sticks for `share` of every `period`: -drag w brakes it and `torque`
    twists it [N·m].
    """
    stuck = np.mod(motion.t, period) < share * period
    twist = stuck * (torque - drag * motion.x[..., W][..., axis])
    return _torque(twist[..., None] * np.eye(3)[axis])


def spinning_lidar(vehicle, motion, h):
    """A part that turns steadily, whatever the rotors do: tau = -w x h, h along body z [N·m·s]."""
    return _torque(-np.cross(motion.x[..., W], [0.0, 0.0, h]))


# Between command and thrust of the rotors; commands are (..., 4) [N].


def bent_thrust_curve(vehicle, command, state, bend):
    """A bent thrust curve: f = c - bend (c - h)³ / h² with h the thrust of a hovering rotor."""
    hover = _weight(vehicle) / 4
    none = command[..., :0]
    return none, none, np.maximum(command - bend * (command - hover) ** 3 / hover**2, 0.0)


def creeping_blades(vehicle, command, state, creep, time):
    """Soft blades give way slowly: f = c (1 - creep (s - 1)), time s' = c / h - s, h that in
    hover; state (..., 4) [1].
    """
    at_rest = command / (_weight(vehicle) / 4)
    s = at_rest if state is None else state
    return at_rest, (at_rest - s) / time, command * (1.0 - creep * (s - 1.0))


def losing_sync(vehicle, command, state, rotor, loss, jump, time):
    """A motor (0 to 3) whose thrust is to rise too fast loses step with its controller: f = c (1 -
    loss d).

    time d' = g - d, time l' = c - l; g rises from 0 to 1 as (c - l) / h does from `jump` to twice
    that, h the thrust in hover; state (..., 2) [l in N, d].
    """
    asked = command[..., rotor]
    at_rest = np.stack([asked, np.zeros_like(asked)], axis=-1)
    s = at_rest if state is None else state
    ahead = asked - s[..., 0]
    out_of_step = np.clip(ahead / (_weight(vehicle) / 4) / jump - 1.0, 0.0, 1.0)
    rate = np.stack([ahead, out_of_step - s[..., 1]], axis=-1) / time
    return at_rest, rate, command * (1.0 - loss * s[..., 1:] * (np.arange(4) == rotor))


def yaw_backlash(vehicle, command, state, play, time):
    """Yaw torque with play [N·m]: it follows its command only when pushed at the edge of a band,
    with a `time` [s]; state (..., 1) [N·m].
    """
    at_rest = (command @ vehicle.mixer[3])[..., None]
    ahead = at_rest - (at_rest if state is None else state)
    rate = np.sign(ahead) * np.maximum(np.abs(ahead) - play, 0.0) / time
    return at_rest, rate, command - ahead * vehicle.unmixer[:, 3]


def liquid_slosh(vehicle, command, state, frequency, damping, gain):
    """Liquid in a tank as two oscillators (roll, pitch) that the commanded torques drive; it twists
    back.

    s'' = -2 damping w s' - w² s + w² tau, w = 2 pi frequency; extra torque = -gain s; state (...,
    4) [N·m, N·m/s].
    """
    w = 2 * np.pi * frequency
    tau = command @ vehicle.mixer[1:3].T
    at_rest = np.concatenate([tau, np.zeros_like(tau)], axis=-1)
    s, moving = np.split(at_rest if state is None else state, 2, axis=-1)
    rate = np.concatenate([moving, w**2 * (tau - s) - 2 * damping * w * moving], axis=-1)
    return at_rest, rate, command - gain * (s @ vehicle.unmixer[:, 1:3].T)


# How each is drawn; the order of its numbers is that of the draw.
DRAWS: dict[str, Callable[[np.random.Generator, Vehicle], Effect]] = {
    "rotor_saturation": lambda rng, v: OutOfLibraryWrench(
        rotor_saturation, limit=(1.0 + log_uniform(rng, 0.12, 0.6)) * _weight(v) / 4
    ),
    "bent_thrust_curve": lambda rng, v: OutOfLibraryActuator(
        bent_thrust_curve, bend=log_uniform(rng, 0.02, 0.12)
    ),
    "creeping_blades": lambda rng, v: OutOfLibraryActuator(
        creeping_blades, creep=log_uniform(rng, 0.08, 0.6), time=rng.uniform(0.5, 2.5)
    ),
    "losing_sync": lambda rng, v: OutOfLibraryActuator(
        losing_sync,
        loss=log_uniform(rng, 0.05, 0.4),
        jump=rng.uniform(0.015, 0.05),
        rotor=int(rng.integers(4)),
        time=rng.uniform(0.2, 0.6),
    ),
    "yaw_backlash": lambda rng, v: OutOfLibraryActuator(
        yaw_backlash, play=log_uniform(rng, 0.3, 2.0) * v.J[2, 2], time=0.015
    ),
    "rotational_damping": lambda rng, v: OutOfLibraryWrench(
        rotational_damping, c=log_uniform(rng, 0.5, 5.0) * v.J[0, 0]
    ),
    "vortex_ring": lambda rng, v: OutOfLibraryWrench(
        vortex_ring,
        speed=(speed := rng.uniform(0.6, 1.8)),
        loss=log_uniform(rng, 0.04, 0.3),
        width=rng.uniform(0.3, 0.5) * speed,
    ),
    "odd_propeller": lambda rng, v: OutOfLibraryWrench(
        odd_propeller, rotor=int(rng.integers(4)), c=signed(rng, 0.03, 0.3) * v.mass
    ),
    "periodic_force": lambda rng, v: OutOfLibraryWrench(
        periodic_force,
        force=tuple(log_uniform(rng, 0.03, 0.2) * _weight(v) * direction(rng)),
        frequency=log_uniform(rng, 0.4, 4.0),
        phase=rng.uniform(0, 2 * np.pi),
    ),
    "ground_tether": lambda rng, v: OutOfLibraryWrench(
        ground_tether,
        anchor=(*rng.uniform(-1.5, 1.5, 2), 0.0),
        stiffness=log_uniform(rng, 0.3, 2.0) * v.mass,
        slack=rng.uniform(0.3, 1.2),
    ),
    "winch_tether": lambda rng, v: OutOfLibraryWrench(
        winch_tether,
        tension=log_uniform(rng, 0.03, 0.25) * _weight(v),
        anchor=(*rng.uniform(-1.5, 1.5, 2), 0.0),
        friction=rng.uniform(0.1, 0.5),
        creep=rng.uniform(0.05, 0.2),
    ),
    "rubbing_line": lambda rng, v: OutOfLibraryWrench(
        rubbing_line, force=log_uniform(rng, 0.01, 0.12) * _weight(v), creep=rng.uniform(0.1, 0.4)
    ),
    "twisted_cable": lambda rng, v: OutOfLibraryWrench(
        twisted_cable, k=log_uniform(rng, 0.5, 5.0) * v.J[2, 2]
    ),
    "sticking_axis": lambda rng, v: OutOfLibraryWrench(
        sticking_axis,
        axis=(axis := int(rng.integers(3))),
        torque=float(rng.choice([-1, 1]) * log_uniform(rng, 0.6, 4.0) * v.J[axis, axis]),
        drag=log_uniform(rng, 0.5, 4.0) * v.J[axis, axis],
        period=rng.uniform(1.5, 5.0),
        share=rng.uniform(0.15, 0.5),
    ),
    "spinning_lidar": lambda rng, v: OutOfLibraryWrench(
        spinning_lidar, h=signed(rng, 0.5, 10.0) * v.J[0, 0]
    ),
    "liquid_slosh": lambda rng, v: OutOfLibraryActuator(
        liquid_slosh,
        frequency=rng.uniform(1.0, 4.0),
        damping=rng.uniform(0.05, 0.2),
        gain=log_uniform(rng, 0.1, 0.35),
    ),
    "wall_suction": lambda rng, v: OutOfLibraryWrench(
        wall_suction,
        normal=level_direction(rng),
        strength=log_uniform(rng, 0.04, 0.25),
        reach=rng.uniform(0.3, 1.0),
        from_origin=rng.uniform(0.8, 2.5),
    ),
    "fan_jet": lambda rng, v: OutOfLibraryWrench(
        fan_jet,
        force=tuple(log_uniform(rng, 0.04, 0.3) * _weight(v) * direction(rng, 0.2)),
        center=tuple(rng.uniform([-1.0, -1.0, 1.0], [1.0, 1.0, 2.5])),
        size=rng.uniform(0.5, 1.2),
    ),
    "wind_shear": lambda rng, v: OutOfLibraryWrench(
        wind_shear,
        c=log_uniform(rng, 0.1, 1.0) * v.mass,
        height=rng.uniform(1.0, 2.0),
        course=rng.uniform(-np.pi, np.pi),
    ),
    "doorway_draft": lambda rng, v: OutOfLibraryWrench(
        doorway_draft,
        force=tuple(log_uniform(rng, 0.03, 0.2) * _weight(v) * direction(rng, 0.2)),
        normal=level_direction(rng),
        from_origin=rng.uniform(-0.7, 0.7),
        edge=rng.uniform(0.05, 0.3),
    ),
}
# A set cycles through these twenty slots in this order; a law may have two, so that the cases of a
# seed stay those of the forty laws that there were.
DEVELOPMENT = (
    "fan_jet",
    "periodic_force",
    "rotational_damping",
    "yaw_backlash",
    "ground_tether",
    "sticking_axis",
    "wall_suction",
    "rotor_saturation",
    "bent_thrust_curve",
    "wind_shear",
    "yaw_backlash",
    "liquid_slosh",
    "vortex_ring",
    "twisted_cable",
    "ground_tether",
    "rotor_saturation",
    "twisted_cable",
    "fan_jet",
    "vortex_ring",
    "wind_shear",
)
# Held out: in no ordinary set.
HOLDOUT = (
    "rubbing_line",
    "doorway_draft",
    "odd_propeller",
    "winch_tether",
    "spinning_lidar",
    "spinning_lidar",
    "creeping_blades",
    "winch_tether",
    "losing_sync",
    "rubbing_line",
    "doorway_draft",
    "odd_propeller",
    "losing_sync",
    "creeping_blades",
    "winch_tether",
    "doorway_draft",
    "odd_propeller",
    "rubbing_line",
    "spinning_lidar",
    "losing_sync",
)
