"""Conversion of the commanded input to propeller forces on the plant."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import MatrixGain, Saturation

from np_drake.effects.base import ActuatorEffect
from np_drake.effects.combine import NO_ONSETS, Onsets
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle
from systems.actuator_effects import ActuatorEffects, Span
from systems.command_buffer import SOONEST, CommandBuffer


class RotorPorts(NamedTuple):
    """Output ports of the rotors."""

    thrust: OutputPort  # actual (4,) [N]
    nominal_thrust: OutputPort  # of nominal rotors at this speed (4,) [N]
    rate: OutputPort | None  # of rotor speed (4,) [rad/s²], None for zero


def add_rotors(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    vehicle: Vehicle,
    effects: Sequence[ActuatorEffect],
    *,
    hover_thrust: np.ndarray,
    command_period: float,
    onsets: Onsets = NO_ONSETS,
) -> RotorPorts:
    """Add mixer, saturation, dead time, actuator effects and propellers on the plant's body
    `quadrotor`.

    Exports the input `u`.

    Args:
        builder: of the diagram.
        plant: with the body.
        vehicle: nominal.
        effects: of the actuators, first to last.
        hover_thrust: (4,) at which delayed commands and lagging rotors start [N].
        command_period: see `CommandBuffer` [s].
        onsets: of effects that begin in flight [s].
    """
    ports = add_rotor_chain(
        builder,
        vehicle,
        effects,
        hover_thrust=hover_thrust,
        command_period=command_period,
        onsets=onsets,
    )
    propellers = add_propellers(builder, plant, vehicle, ports.thrust, body="quadrotor")
    builder.Connect(plant.get_body_poses_output_port(), propellers.get_body_poses_input_port())
    builder.Connect(
        propellers.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port()
    )
    return ports


def add_rotor_chain(
    builder: DiagramBuilder,
    vehicle: Vehicle,
    effects: Sequence[ActuatorEffect],
    *,
    hover_thrust: np.ndarray,
    command_period: float,
    onsets: Onsets = NO_ONSETS,
) -> RotorPorts:
    """Add what lies between the command `u`, which is exported, and rotor thrust.

    Args:
        builder: of the diagram.
        vehicle: nominal.
        effects: of the actuators, first to last.
        hover_thrust: (4,) at which delayed commands and lagging rotors start [N].
        command_period: see `CommandBuffer` [s].
        onsets: of effects that begin in flight [s].
    """
    chain, spans = with_nominal_lag(vehicle, effects, onsets)
    command = add_commanded_thrust(
        builder,
        vehicle,
        chain,
        hover_thrust=hover_thrust,
        command_period=command_period,
        onsets=onsets,
    )
    ports = RotorPorts(command, command, None)
    if chain:
        system = ActuatorEffects(vehicle, chain, hover_thrust, spans=spans)
        actuators = builder.AddNamedSystem("actuators", system)
        builder.Connect(command, actuators.get_input_port())
        names = ("thrust", "nominal_thrust", "rotor_rate")
        ports = RotorPorts(*(actuators.GetOutputPort(name) for name in names))
    return ports


def add_commanded_thrust(
    builder: DiagramBuilder,
    vehicle: Vehicle,
    chain: Sequence[ActuatorEffect],
    *,
    hover_thrust: np.ndarray,
    command_period: float,
    onsets: Onsets = NO_ONSETS,
) -> OutputPort:
    """Add mixer, saturation and dead times behind the command `u`, which is exported, and return
    the port (4,) [N].

    Args:
        builder: of the diagram.
        vehicle: nominal.
        chain: effects that do something, whose dead times count.
        hover_thrust: (4,) at which delayed commands start [N].
        command_period: see `CommandBuffer` [s].
        onsets: of effects that begin in flight [s].
    """
    mixer = builder.AddNamedSystem("mixer", MatrixGain(vehicle.unmixer))
    limit = builder.AddNamedSystem(
        "saturation", Saturation(np.zeros(4), np.full(4, vehicle.max_rotor_thrust))
    )
    builder.ExportInput(mixer.get_input_port(), "u")
    builder.Connect(mixer.get_output_port(), limit.get_input_port())
    command = limit.get_output_port()
    for onset, dead_time in _dead_times(chain, onsets):
        buffer = CommandBuffer(
            hover_thrust, dead_time=dead_time, period=command_period, onset=onset
        )
        name = "command_buffer" if onset == -np.inf else f"command_buffer_from_{onset:g}"
        builder.AddNamedSystem(name, buffer)
        builder.Connect(command, buffer.get_input_port())
        command = buffer.get_output_port()
    return command


def with_nominal_lag(
    vehicle: Vehicle, effects: Sequence[ActuatorEffect], onsets: Onsets
) -> tuple[list[ActuatorEffect], dict[ActuatorEffect, Span]]:
    """Return the effects that do something, after the vehicle file's nominal lag, and when those
    act that do at times.

    The nominal lag acts until the effects have a lag of their own.

    Args:
        vehicle: nominal.
        effects: of the actuators, first to last.
        onsets: of effects that begin in flight [s].
    """
    chain = [e for e in effects if not getattr(e, "parameters", ()) or e != type(e).neutral()]
    spans: dict[ActuatorEffect, Span] = {e: (onsets[e], np.inf) for e in chain if e in onsets}
    own = min((onsets.get(e, -np.inf) for e in effects if isinstance(e, MotorLag)), default=np.inf)
    nominal = MotorLag(vehicle.rotor_time_constant)
    if nominal in chain:  # it goes on as it was
        spans.pop(nominal, None)
    elif vehicle.rotor_time_constant > 0 and own > 0:
        # After the other lag, whose state then follows the command, as that of a lag that acts all
        # the time.
        lags = [k for k, effect in enumerate(chain) if isinstance(effect, MotorLag)]
        chain.insert(1 + lags[-1] if lags else 0, nominal)
        spans |= {nominal: (-np.inf, own)} if own < np.inf else {}
    return chain, spans


def _dead_times(chain: Sequence[ActuatorEffect], onsets: Onsets) -> list[tuple[float, float]]:
    """Return (onset, dead time) [s] of the delays of the commands, those of one onset in a sum."""
    total: dict[float, float] = {}
    for effect in chain:
        onset = onsets.get(effect, -np.inf)
        total[onset] = total.get(onset, 0.0) + effect.dead_time
    return [
        (onset, dead_time) for onset, dead_time in sorted(total.items()) if dead_time >= SOONEST
    ]


def add_propellers(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    vehicle: Vehicle,
    thrust: OutputPort,
    *,
    body: str,
) -> Propeller:
    """Add propellers to a body of the plant, with body poses and forces left to connect.

    Args:
        builder: of the diagram with the plant.
        plant: finalized.
        vehicle: places and coefficients of the rotors.
        thrust: port (4,) [N].
        body: name of the vehicle's body.
    """
    kappa = vehicle.torque_coefficient / vehicle.thrust_coefficient
    index = plant.GetBodyByName(body).index()
    info = [
        PropellerInfo(index, RigidTransform(p), thrust_ratio=1.0, moment_ratio=direction * kappa)
        for p, direction in zip(vehicle.rotor_positions, vehicle.rotor_directions, strict=True)
    ]
    propellers = builder.AddNamedSystem("propellers", Propeller(info))
    builder.Connect(thrust, propellers.get_command_input_port())
    return propellers
