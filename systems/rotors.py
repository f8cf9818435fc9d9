"""Conversion of the commanded input to propeller forces on the plant, through the effects of the
actuators.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo
from pydrake.systems.framework import (
    BasicVector,
    DiagramBuilder,
    LeafSystem,
    OutputPort,
    ValueProducer,
)
from pydrake.systems.primitives import MatrixGain, Saturation

from np_drake.effects.base import ActuatorEffect
from np_drake.effects.combine import NO_ONSETS, Onsets
from np_drake.effects.motor_lag import MotorLag
from np_drake.vehicle import Vehicle
from systems.command_buffer import SOONEST, CommandBuffer

Span = tuple[float, float]  # begin and end [s]
ALWAYS: Mapping[ActuatorEffect, Span] = {}


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
    kappa = vehicle.torque_coefficient / vehicle.thrust_coefficient
    index = plant.GetBodyByName("quadrotor").index()
    info = [
        PropellerInfo(index, RigidTransform(p), thrust_ratio=1.0, moment_ratio=direction * kappa)
        for p, direction in zip(vehicle.rotor_positions, vehicle.rotor_directions, strict=True)
    ]
    propellers = builder.AddNamedSystem("propellers", Propeller(info))
    builder.Connect(ports.thrust, propellers.get_command_input_port())
    builder.Connect(plant.get_body_poses_output_port(), propellers.get_body_poses_input_port())
    builder.Connect(
        propellers.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port()
    )
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
    lag_begins = min(
        (onsets.get(e, -np.inf) for e in effects if isinstance(e, MotorLag)), default=np.inf
    )
    nominal = MotorLag(vehicle.rotor_time_constant)
    if nominal in chain:  # it goes on as it was
        spans.pop(nominal, None)
    elif vehicle.rotor_time_constant > 0 and lag_begins > 0:
        # After the other lag, whose state then follows the command, as that of a lag that acts all
        # the time.
        lags = [k for k, effect in enumerate(chain) if isinstance(effect, MotorLag)]
        chain.insert(1 + lags[-1] if lags else 0, nominal)
        spans |= {nominal: (-np.inf, lag_begins)} if lag_begins < np.inf else {}
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


class ActuatorEffects(LeafSystem):
    """Chain of actuator effects through which rotor thrust passes, first to last.

    Their dead times are not in it: they belong on the command (`CommandBuffer`), of which all of
    them only see more.

    .. pydrake_system::

        name: ActuatorEffects
        input_ports:
        - command
        output_ports:
        - thrust
        - nominal_thrust
        - rotor_rate
        - state

    | port | size | meaning | unit |
    |---|---|---|---|
    | command | 4 | commanded rotor thrust after saturation and dead time | N |
    | thrust | 4 | actual rotor thrust | N |
    | nominal_thrust | 4 | what a nominal rotor would give at the actual rotor speed | N |
    | rotor_rate | 4 | time derivative of rotor speed; zero where nothing lags | rad/s² |
    | state | sum of sizes | the continuous state | |

    Continuous state: the effects' states one after the other; it starts at rest under hover thrust.
    The state of the last effect that turns the rotors and has four states is rotor speed.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Sequence[ActuatorEffect],
        hover_thrust: np.ndarray,
        *,
        spans: Mapping[ActuatorEffect, Span] = ALWAYS,
    ):
        """Declare ports and state.

        Args:
            vehicle: nominal.
            effects: first to last.
            hover_thrust: (4,) command at which the states start at rest [N].
            spans: begin and end of effects that do not act all the time [s]; an idle one hands the
                thrust on, and its state follows.
        """
        super().__init__()
        self._vehicle = vehicle
        self._stages = _stages(effects, spans)
        self._lagging = [stage for stage in self._stages if stage.effect.state_size]
        self._command_port = self.DeclareVectorInputPort("command", 4)
        self._state_index = self.DeclareContinuousState(
            BasicVector(self._resting_state(hover_thrust))
        )
        prerequisites = {self.all_input_ports_ticket(), self.all_state_ticket(), self.time_ticket()}
        self.DeclareVectorOutputPort("thrust", 4, self._calc_thrust, prerequisites)
        self.DeclareVectorOutputPort("nominal_thrust", 4, self._calc_nominal_thrust, prerequisites)
        self.DeclareVectorOutputPort("rotor_rate", 4, self._calc_rotor_rate, prerequisites)
        self.DeclareStateOutputPort("state", self._state_index)
        producer = ValueProducer(allocate=Value[object], calc=self._calc_rates)
        self._rates = self.DeclareCacheEntry("rates", producer, prerequisites)

    def _resting_state(self, thrust: np.ndarray) -> np.ndarray:
        states = []
        passed = np.asarray(thrust, float)
        for stage in self._stages:
            states.append(stage.effect.state_at(self._vehicle, passed))
            if stage.acts(0.0):
                passed = stage.effect.thrust(self._vehicle, states[-1], passed, 0.0)
        return np.concatenate(states) if states else np.zeros(0)

    def rest_at(self, context, thrust: np.ndarray) -> None:
        """Set the state at which a constant command rests.

        Args:
            context: the system's own.
            thrust: (4,) command [N].
        """
        context.SetContinuousState(self._resting_state(thrust))

    def _passed(
        self, stages: Sequence["Stage"], state: np.ndarray, thrust: np.ndarray, t: float
    ) -> np.ndarray:
        """Return the thrust (4,) [N] after these stages."""
        for stage in stages:
            if stage.acts(t):
                thrust = stage.effect.thrust(self._vehicle, state[stage.where], thrust, t)
        return thrust

    def _given(self, context) -> tuple[np.ndarray, np.ndarray, float]:
        """Return state, command [N] and time [s]."""
        state = context.get_continuous_state_vector().CopyToVector()
        return state, self._command_port.Eval(context), context.get_time()

    def _rate(self, stage: "Stage", state: np.ndarray, command: np.ndarray, t: float) -> np.ndarray:
        """Return the rate of a stage's state; `command` is that of the chain [N]."""
        passed = self._passed(self._stages[: stage.place], state, command, t)
        return stage.effect.state_rate(self._vehicle, state[stage.where], passed)

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Compute the effects' state rates, as an override of Drake's virtual."""
        if self._lagging:
            derivatives.SetFromVector(np.concatenate(self._rates.Eval(context)))

    def _calc_rates(self, context, rates) -> None:
        given = self._given(context)
        rates.set_value([self._rate(stage, *given) for stage in self._lagging])

    def _calc_thrust(self, context, output) -> None:
        output.SetFromVector(self._passed(self._stages, *self._given(context)))

    def _calc_nominal_thrust(self, context, output) -> None:
        motors = [stage for stage in self._stages if stage.effect.turns_rotor]
        output.SetFromVector(self._passed(motors, *self._given(context)))

    def _calc_rotor_rate(self, context, output) -> None:
        rate = np.zeros(4)
        for stage, stage_rate in zip(self._lagging, self._rates.Eval(context), strict=True):
            turns = stage.effect.turns_rotor and stage.effect.state_size == 4
            if turns and stage.acts(context.get_time()):
                rate = stage_rate
        output.SetFromVector(rate)


class Stage(NamedTuple):
    """An effect in its chain."""

    effect: ActuatorEffect
    place: int  # in the chain
    where: slice  # its part of the state
    begin: float  # from then on it acts [s]
    end: float  # until then [s]

    def acts(self, t: float) -> bool:
        """Return whether it acts at time t [s]."""
        return self.begin <= t < self.end


def _stages(effects: Sequence[ActuatorEffect], spans: Mapping[ActuatorEffect, Span]) -> list[Stage]:
    ends = np.cumsum([0] + [e.state_size for e in effects]).tolist()
    parts = [slice(a, b) for a, b in itertools.pairwise(ends)]
    always = (-np.inf, np.inf)
    return [Stage(e, k, parts[k], *spans.get(e, always)) for k, e in enumerate(effects)]
