"""Actuator wrapper: effects between commanded and actual rotor thrust."""

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake.effects.base import ActuatorEffect
from np_drake.vehicle import Vehicle

Span = tuple[float, float]  # begin and end [s]
ALWAYS: Mapping[ActuatorEffect, Span] = {}


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

    | port | size | meaning | unit |
    |---|---|---|---|
    | command | 4 | commanded rotor thrust after saturation and dead time | N |
    | thrust | 4 | actual rotor thrust | N |
    | nominal_thrust | 4 | what a nominal rotor would give at the actual rotor speed | N |
    | rotor_rate | 4 | time derivative of rotor speed; zero where nothing lags | rad/s² |

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
        self.DeclareContinuousState(BasicVector(self._resting_state(hover_thrust)))
        prerequisites = {self._command_port.ticket(), self.all_state_ticket(), self.time_ticket()}
        self.DeclareVectorOutputPort("thrust", 4, self._calc_thrust, prerequisites)
        self.DeclareVectorOutputPort("nominal_thrust", 4, self._calc_nominal_thrust, prerequisites)
        self.DeclareVectorOutputPort("rotor_rate", 4, self._calc_rotor_rate, prerequisites)

    def _resting_state(self, thrust: np.ndarray) -> np.ndarray:
        states, passed = [], np.asarray(thrust, float)
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
        own = self._passed(self._stages[: stage.place], state, command, t)
        return stage.effect.state_rate(self._vehicle, state[stage.where], own)

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Compute the effects' state rates, as an override of Drake's virtual."""
        if self._lagging:
            given = self._given(context)
            rates = [self._rate(stage, *given) for stage in self._lagging]
            derivatives.SetFromVector(rates[0] if len(rates) == 1 else np.concatenate(rates))

    def _calc_thrust(self, context, output) -> None:
        output.SetFromVector(self._passed(self._stages, *self._given(context)))

    def _calc_nominal_thrust(self, context, output) -> None:
        motors = [stage for stage in self._stages if stage.effect.turns_rotor]
        output.SetFromVector(self._passed(motors, *self._given(context)))

    def _calc_rotor_rate(self, context, output) -> None:
        rate, given = np.zeros(4), self._given(context)
        for stage in self._lagging:
            if stage.effect.turns_rotor and stage.effect.state_size == 4 and stage.acts(given[2]):
                rate = self._rate(stage, *given)
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
