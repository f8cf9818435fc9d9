"""The actuator wrapper: effects between commanded and actual rotor thrust."""

import itertools

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake.effects.base import ActuatorEffect
from np_drake.vehicle import Vehicle


class ActuatorEffects(LeafSystem):
    """Passes rotor thrust through a chain of actuator effects, first to last.

    .. pydrake_system::

        name: ActuatorEffects
        input_ports:
        - command
        output_ports:
        - thrust
        - nominal_thrust

    | port | size | meaning | unit |
    |---|---|---|---|
    | command | 4 | commanded rotor thrust after saturation | N |
    | thrust | 4 | actual rotor thrust | N |
    | nominal_thrust | 4 | what a nominal rotor would give at the actual rotor speed | N |

    Continuous state: the effects' states one after the other; it starts at rest under hover thrust.
    """

    def __init__(self, vehicle: Vehicle, effects: list[ActuatorEffect], hover_thrust: np.ndarray):
        super().__init__()
        self._vehicle, self._effects = vehicle, list(effects)
        ends = np.cumsum([0] + [e.state_size for e in effects])
        self._slices = [slice(a, b) for a, b in itertools.pairwise(ends)]
        self._command_port = self.DeclareVectorInputPort("command", 4)
        self.DeclareContinuousState(BasicVector(self._resting_state(hover_thrust)))
        prerequisites = {self._command_port.ticket(), self.all_state_ticket()}
        self.DeclareVectorOutputPort("thrust", 4, self._calc_thrust, prerequisites)
        self.DeclareVectorOutputPort("nominal_thrust", 4, self._calc_nominal_thrust, prerequisites)

    def _resting_state(self, thrust: np.ndarray) -> np.ndarray:
        states, passed = [], np.asarray(thrust, float)
        for effect in self._effects:
            states.append(effect.state_at(self._vehicle, passed))
            passed = effect.thrust(self._vehicle, states[-1], passed)
        return np.concatenate(states) if states else np.zeros(0)

    def _chain(self, context) -> tuple[list[np.ndarray], np.ndarray]:
        """What each effect is commanded, and the thrust after the last [N]."""
        state = context.get_continuous_state_vector().CopyToVector()
        commands, thrust = [], self._command_port.Eval(context)
        for effect, where in zip(self._effects, self._slices, strict=True):
            commands.append(thrust)
            thrust = effect.thrust(self._vehicle, state[where], thrust)
        return commands, thrust

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Drake's hook: the effects' own state rates."""
        state = context.get_continuous_state_vector().CopyToVector()
        commands, _ = self._chain(context)
        rates = [
            effect.state_rate(self._vehicle, state[where], command)
            for effect, where, command in zip(self._effects, self._slices, commands, strict=True)
            if effect.state_size
        ]
        if rates:
            derivatives.SetFromVector(rates[0] if len(rates) == 1 else np.concatenate(rates))

    def _calc_thrust(self, context, output) -> None:
        output.SetFromVector(self._chain(context)[1])

    def _calc_nominal_thrust(self, context, output) -> None:
        state = context.get_continuous_state_vector().CopyToVector()
        thrust = self._command_port.Eval(context)
        for effect, where in zip(self._effects, self._slices, strict=True):
            if effect.turns_rotor:
                thrust = effect.thrust(self._vehicle, state[where], thrust)
        output.SetFromVector(thrust)
