"""Actuator wrapper: effects between commanded and actual rotor thrust."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, LeafSystem, ValueProducer

from np_drake.effects.base import ActuatorEffect
from np_drake.vehicle import Vehicle

Span = tuple[float, float]  # begin and end [s]
ALWAYS: Mapping[ActuatorEffect, Span] = {}


class ActuatorEffects(LeafSystem):
    """Chain of actuator effects through which rotor thrust passes, first to last.

    Their dead times are not in it: they belong on the command (`CommandBuffer`), of which all of them only see more.

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

    Continuous state: the effects' states one after the other; it starts at rest under hover thrust. The state of the
    last effect that turns the rotors and has four states is rotor speed.
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

        Args: effects: first to last.   hover_thrust: (4,) command at which the states start at rest [N].
        spans: begin and end of effects that do not act all the time [s]; an idle one hands the thrust on, and its state
        follows.
        """
        super().__init__()
        self._vehicle, self._effects, self._spans = vehicle, list(effects), spans
        ends = np.cumsum([0] + [e.state_size for e in effects])
        self._slices = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self._command_port = self.DeclareVectorInputPort("command", 4)
        self.DeclareContinuousState(BasicVector(self._resting_state(hover_thrust)))
        prerequisites = {self._command_port.ticket(), self.all_state_ticket(), self.time_ticket()}
        # Thrust and state rates of one instant read the same pass through the effects.
        self._chain = self.DeclareCacheEntry(
            "chain", ValueProducer(allocate=Value[object], calc=self._calc_chain), prerequisites
        )
        self.DeclareVectorOutputPort("thrust", 4, self._calc_thrust, prerequisites)
        self.DeclareVectorOutputPort("nominal_thrust", 4, self._calc_nominal_thrust, prerequisites)
        self.DeclareVectorOutputPort("rotor_rate", 4, self._calc_rotor_rate, prerequisites)

    def _resting_state(self, thrust: np.ndarray) -> np.ndarray:
        states, passed = [], np.asarray(thrust, float)
        for effect in self._effects:
            states.append(effect.state_at(self._vehicle, passed))
            passed = self._through(effect, states[-1], passed, 0.0)
        return np.concatenate(states) if states else np.zeros(0)

    def _acts(self, effect: ActuatorEffect, t: float) -> bool:
        begin, end = self._spans.get(effect, (-np.inf, np.inf))
        return begin <= t < end

    def _through(self, effect: ActuatorEffect, state: np.ndarray, thrust: np.ndarray, t: float) -> np.ndarray:
        return effect.thrust(self._vehicle, state, thrust, t) if self._acts(effect, t) else thrust

    def rest_at(self, context, thrust: np.ndarray) -> None:
        """Set the state at which a constant command `thrust` (4,) [N] rests; `context` is the system's own."""
        context.SetContinuousState(self._resting_state(thrust))

    def _calc_chain(self, context, value) -> None:
        """Compute the state, the command of each effect, and the thrust after the last [N]."""
        state = context.get_continuous_state_vector().CopyToVector()
        commands, thrust, t = [], self._command_port.Eval(context), context.get_time()
        for effect, where in zip(self._effects, self._slices, strict=True):
            commands.append(thrust)
            thrust = self._through(effect, state[where], thrust, t)
        value.set_value((state, commands, thrust))

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Compute the effects' state rates, as an override of Drake's virtual."""
        state, commands, _ = self._chain.Eval(context)
        rates = [
            effect.state_rate(self._vehicle, state[where], command)
            for effect, where, command in zip(self._effects, self._slices, commands, strict=True)
            if effect.state_size
        ]
        if rates:
            derivatives.SetFromVector(rates[0] if len(rates) == 1 else np.concatenate(rates))

    def _calc_thrust(self, context, output) -> None:
        output.SetFromVector(self._chain.Eval(context)[2])

    def _calc_nominal_thrust(self, context, output) -> None:
        state = context.get_continuous_state_vector().CopyToVector()
        thrust = self._command_port.Eval(context)
        for effect, where in zip(self._effects, self._slices, strict=True):
            if effect.turns_rotor:
                thrust = self._through(effect, state[where], thrust, context.get_time())
        output.SetFromVector(thrust)

    def _calc_rotor_rate(self, context, output) -> None:
        state, commands, _ = self._chain.Eval(context)
        rate = np.zeros(4)
        for effect, where, command in zip(self._effects, self._slices, commands, strict=True):
            if effect.turns_rotor and effect.state_size == 4 and self._acts(effect, context.get_time()):
                rate = effect.state_rate(self._vehicle, state[where], command)
        output.SetFromVector(rate)
