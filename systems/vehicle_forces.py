"""Rotors, rotor drag and cable in one compiled function, for a vehicle whose effects are steady."""

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import Integrator, MatrixGain, Multiplexer

from np_drake import attitude
from np_drake.compiled import compiled, turned
from np_drake.effects.base import ActuatorEffect, WrenchEffect
from np_drake.effects.combine import NO_ONSETS, Onsets
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.linear_drag import LinearDrag, add_drag
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.effects.uneven_lag import UnevenLag
from np_drake.effects.weak_rotor import WeakRotor
from np_drake.vehicle import Vehicle
from systems.cable import Cable, cable_force
from systems.plant_readings import vehicle_state
from systems.rotors import ActuatorEffects, RotorPorts, add_commanded_thrust, with_nominal_lag
from systems.wrench_effects import PUSH, WRENCH, export_pushes

LAGS = (MotorLag, UnevenLag)  # whose state is rotor speed
STEADY_GAINS = (ThrustScale, WeakRotor)  # actuator effects whose gain of thrust never changes


@dc.dataclass(frozen=True)
class SteadyEffects:
    """Effects that the compiled function knows: a lag of the rotors or none, then gains of thrust,
    and drag in still air.

    chain: the actuators' effects that do something, dead times among them.
    gains: (4,) of the rotors' thrust [1].
    drag: (3,) coefficients along the body axes [N·s/m].
    others: effects that push by themselves; with moving air the drags are among them.
    """

    chain: list[ActuatorEffect]
    lag: MotorLag | None  # or its subclass UnevenLag
    gains: np.ndarray
    drag: np.ndarray
    others: list[WrenchEffect]

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        actuator_effects: Sequence[ActuatorEffect],
        wrench_effects: Sequence[WrenchEffect],
        onsets: Onsets = NO_ONSETS,
    ) -> "SteadyEffects | None":
        """Return the effects in this form; None where the actuators have others, or one begins in
        flight.

        Args:
            vehicle: nominal, with its own lag.
            actuator_effects: first to last.
            wrench_effects: in any order.
            onsets: of effects that begin in flight [s].
        """
        chain, _ = with_nominal_lag(vehicle, actuator_effects, onsets)
        acting = [effect for effect in chain if type(effect) is not CommandDelay]
        lag: Any = next((effect for effect in acting[:1] if type(effect) in LAGS), None)
        scales = acting if lag is None else acting[1:]
        if onsets or not all(type(effect) in STEADY_GAINS for effect in scales):
            return None
        gains = np.ones(4)
        for effect in scales:
            gains *= effect.thrust_gain(0.0)
        others = list(wrench_effects)
        if all(type(e).air_velocity is WrenchEffect.air_velocity for e in others):
            others = [effect for effect in wrench_effects if type(effect) is not LinearDrag]
        drags = [[e.d_x, e.d_y, e.d_z] for e in wrench_effects if e not in others]  # type: ignore[attr-defined]
        return cls(chain, lag, gains, np.sum([[0.0] * 3, *drags], axis=0), others)


class VehicleForces(LeafSystem):
    """Generalized force of rotors, rotor drag and cable, all in one call.

    It is the sum of what `Propeller`, `WrenchEffects`, `Cable` and `ExternalForces` give for the
    same effects.

    .. pydrake_system::

        name: VehicleForces
        input_ports:
        - plant_state
        - command
        - rotor_speed
        - holds
        - external_wrench (optional)
        - payload_force (optional)
        output_ports:
        - target
        - generalized_force
        - thrust
        - nominal_thrust

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | nq + nv | Drake's order, the quadrotor first | |
    | command | 4 | commanded rotor thrust after saturation and dead time | N |
    | rotor_speed | 4 | actual | rad/s |
    | holds | 1 | 1 while the cable holds, else 0; with a cable only | |
    | external_wrench, payload_force | 6, 3 | as of `ExternalForces` | N, N·m |
    | target | 4 | speed at which a rotor gives the commanded thrust | rad/s |
    | generalized_force | nv | [moment about Bo, force] on B, then on a payload, in W | N·m, N |
    | thrust | 4 | actual rotor thrust | N |
    | nominal_thrust | 4 | what a nominal rotor would give at the actual rotor speed | N |

    No state.
    """

    def __init__(self, vehicle: Vehicle, effects: SteadyEffects, cable: Cable | None, size: int):
        """Declare ports.

        Args:
            vehicle: nominal.
            effects: that act on it.
            cable: without mass, on which the only other body hangs; None: there is none.
            size: nv of the plant [1].
        """
        super().__init__()
        self._vehicle = vehicle
        self._gains = effects.gains
        self._size = size
        hover = float(np.sqrt(vehicle.mass * vehicle.gravity / 4))
        rotors = (
            vehicle.thrust_coefficient,
            effects.gains,
            np.ascontiguousarray(vehicle.mixer, float),
        )
        line = (np.zeros(3), np.zeros((1, 3))) if cable is None else cable.line
        self._constants = (*rotors, effects.drag, hover, *line)
        self._state_port = self.DeclareVectorInputPort("plant_state", 13 * self._size // 6)
        self._command_port = self.DeclareVectorInputPort("command", 4)
        self._speed_port = self.DeclareVectorInputPort("rotor_speed", 4)
        self._holds_port = None if cable is None else self.DeclareVectorInputPort("holds", 1)
        self._wrench_port = self.DeclareVectorInputPort(WRENCH, 6)
        self._pushes = [self._wrench_port]
        if size > 6:
            self._pushes.append(self.DeclareVectorInputPort(PUSH, 3))
        speed = {self._speed_port.ticket()}
        ports = (self._state_port, self._holds_port, *self._pushes)
        needed = speed | {port.ticket() for port in ports if port is not None}
        self.DeclareVectorOutputPort("target", 4, self._calc_target, {self._command_port.ticket()})
        self.DeclareVectorOutputPort("generalized_force", self._size, self._calc_force, needed)
        self.DeclareVectorOutputPort("thrust", 4, self._calc_thrust, speed)
        self.DeclareVectorOutputPort("nominal_thrust", 4, self._calc_nominal_thrust, speed)

    def _calc_target(self, context, output) -> None:
        command = self._command_port.Eval(context)
        output.SetFromVector(MotorLag().state_at(self._vehicle, command))

    def _calc_force(self, context, output) -> None:
        holds = 0.0 if self._holds_port is None else self._holds_port.Eval(context)[0]
        state = self._state_port.Eval(context)
        force = np.zeros(self._size)
        _total(state, self._speed_port.Eval(context), holds, *self._constants, force)
        for first, port in zip((3, 9), self._pushes, strict=False):
            if port.HasValue(context):
                pushed = port.Eval(context)
                force[first : first + 3] += pushed[:3]
                if port is self._wrench_port:
                    force[:3] += attitude.rotate(state[:4], pushed[3:])
        output.SetFromVector(force)

    def _calc_thrust(self, context, output) -> None:
        output.SetFromVector(self._gains * self._nominal_thrust(context))

    def _calc_nominal_thrust(self, context, output) -> None:
        output.SetFromVector(self._nominal_thrust(context))

    def _nominal_thrust(self, context) -> np.ndarray:
        return MotorLag().thrust(self._vehicle, self._speed_port.Eval(context), np.zeros(4))


@compiled
def _total(s, speed, holds, k, gains, mixer, drag, hover, hook, pieces, out):
    """Write the generalized force of rotors, drag and a cable that holds to out (6,) or (12,),
    which comes zeroed.

    Args:
        s: state of the plant, (13,) or (26,).
        speed: (4,) of the rotors [rad/s].
        holds: whether there is a cable that holds, 0 or 1.
        k: thrust coefficient [N/(rad/s)²].
        gains: (4,) of the thrust [1].
        mixer: (4, 4) from thrusts to [f_u, tau_m].
        drag: (3,) coefficients [N·s/m].
        hover: as of `add_drag`.
        hook: as of `cable_force`, like the pieces.
        pieces: (1, 3).
        out: to be written [N·m, N].
    """
    thrust = gains * (k * speed * speed)
    x = np.empty(13)
    vehicle_state(s, 0, 7 * (len(s) // 13), x)
    if holds:
        cable_force(s, np.empty((0, 6)), holds, hook, pieces, out, np.empty((0, 3)))
    add_drag(x, thrust, drag[0], drag[1], drag[2], hover, out[3:])
    _add_rotors(x, thrust, mixer, out)


@compiled
def _add_rotors(x, thrust, mixer, out):
    """Add the force of the rotors along body z, and their torque turned to W, to out[:6]."""
    w = x[3]
    i = x[4]
    j = x[5]
    k = x[6]
    # the integrator lets the quaternion drift off the unit sphere
    size = math.sqrt(w * w + i * i + j * j + k * k)
    w = w / size
    i = i / size
    j = j / size
    k = k / size
    total = 0.0
    moment = np.zeros(3)
    for r in range(4):
        total += thrust[r]
        for axis in range(3):
            moment[axis] += mixer[1 + axis, r] * thrust[r]
    m_x, m_y, m_z = turned(w, i, j, k, moment[0], moment[1], moment[2])
    f_x, f_y, f_z = turned(w, i, j, k, 0.0, 0.0, total)
    out[0], out[1], out[2] = out[0] + m_x, out[1] + m_y, out[2] + m_z
    out[3], out[4], out[5] = out[3] + f_x, out[4] + f_y, out[5] + f_z


def add_vehicle_forces(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    vehicle: Vehicle,
    effects: SteadyEffects,
    cable: Cable | None,
    *,
    hover_thrust: np.ndarray,
    command_period: float,
) -> tuple[RotorPorts, OutputPort]:
    """Add what lies between the command `u` and forces from outside, which are exported, and the
    plant; return rotors and generalized force.

    Args:
        builder: of the diagram.
        plant: with the body `quadrotor`, and a `payload` on the cable.
        vehicle: nominal.
        effects: that act on it.
        cable: of the diagram, if it has no mass.
        hover_thrust: (4,) at which delayed commands and lagging rotors start [N].
        command_period: see `CommandBuffer` [s].
    """
    command = add_commanded_thrust(
        builder, vehicle, effects.chain, hover_thrust=hover_thrust, command_period=command_period
    )
    forces = builder.AddNamedSystem(
        "vehicle_forces", VehicleForces(vehicle, effects, cable, plant.num_velocities())
    )
    speed = forces.GetOutputPort("target")
    rate = None
    if type(effects.lag) is MotorLag:
        rotors = builder.AddNamedSystem("actuators", RotorSpeed(vehicle, hover_thrust))
        both = builder.AddSystem(Multiplexer([4, 4]))
        missing = np.hstack([np.eye(4), -np.eye(4)])
        lagging = builder.AddSystem(MatrixGain(missing / effects.lag.time_constant))
        builder.Connect(speed, both.get_input_port(0))
        builder.Connect(rotors.get_output_port(), both.get_input_port(1))
        builder.Connect(both.get_output_port(), lagging.get_input_port())
        builder.Connect(lagging.get_output_port(), rotors.get_input_port())
        speed = rotors.get_output_port()
        rate = lagging.get_output_port()
    elif effects.lag is not None:
        uneven = ActuatorEffects(vehicle, [effects.lag], hover_thrust)
        builder.Connect(command, builder.AddNamedSystem("actuators", uneven).get_input_port())
        speed = uneven.GetOutputPort("state")
        rate = uneven.GetOutputPort("rotor_rate")
    builder.Connect(command, forces.GetInputPort("command"))
    builder.Connect(speed, forces.GetInputPort("rotor_speed"))
    builder.Connect(plant.get_state_output_port(), forces.GetInputPort("plant_state"))
    if cable is not None:
        builder.Connect(cable.GetOutputPort("holds"), forces.GetInputPort("holds"))
    export_pushes(builder, forces)
    ports = RotorPorts(forces.GetOutputPort("thrust"), forces.GetOutputPort("nominal_thrust"), rate)
    return ports, forces.GetOutputPort("generalized_force")


class RotorSpeed(Integrator):
    """Integral of the rotors' acceleration.

    .. pydrake_system::

        name: RotorSpeed
        input_ports:
        - u
        output_ports:
        - y

    | port | size | meaning | unit |
    |---|---|---|---|
    | u | 4 | acceleration | rad/s² |
    | y | 4 | rotor speed | rad/s |

    Continuous state: rotor speed; it starts at rest under hover thrust.

    Args:
        vehicle: nominal.
        hover_thrust: (4,) [N].
    """

    def __init__(self, vehicle: Vehicle, hover_thrust: np.ndarray):
        super().__init__(MotorLag().state_at(vehicle, hover_thrust))
        self._vehicle = vehicle

    def rest_at(self, context: Context, thrust: np.ndarray) -> None:
        """Set the speed at which a constant command rests.

        Args:
            context: the system's own.
            thrust: (4,) command [N].
        """
        context.SetContinuousState(MotorLag().state_at(self._vehicle, thrust))
