"""Forces from outside on the body: effects as force and torque, and a push."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import LeafSystem

from np_drake.compiled import compiled, turned
from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.combine import NO_ONSETS, Onsets, acting, require_complete, total_wrench
from np_drake.vehicle import Vehicle


class WrenchEffects(LeafSystem):
    """Sum of the wrenches of all given effects on the body.

    .. pydrake_system::

        name: WrenchEffects
        input_ports:
        - x
        - rotor_thrust
        - rotor_rate (optional)
        output_ports:
        - generalized_force
        - chi

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | true state | |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | rotor_rate | 4 | time derivative of rotor speed; zero where not connected | rad/s² |
    | generalized_force | nv | [moment about Bo, force] on B in W, zeros for other bodies | N·m, N |
    | chi | 6 | [force in W, torque in B] | N, N·m |
    """

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Sequence[WrenchEffect],
        num_velocities: int,
        *,
        onsets: Onsets = NO_ONSETS,
    ):
        """Declare ports.

        Args:
            vehicle: nominal.
            effects: that push on it.
            num_velocities: nv of the plant [1].
            onsets: of effects that begin in flight [s].
        Raises: ValueError: if an effect lacks what it acts by, as a downwash without a neighbour.
        """
        super().__init__()
        require_complete(effects)
        self._vehicle, self._effects, self._onsets = vehicle, list(effects), onsets
        self._reads_rate = any(effect.feels_rotor_rate for effect in effects)
        self._force = np.zeros(
            num_velocities
        )  # workspace; only the first six entries are ever written
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._thrust_port = self.DeclareVectorInputPort("rotor_thrust", 4)
        self._rate_port = self.DeclareVectorInputPort("rotor_rate", 4)
        prerequisites = {self.all_input_ports_ticket(), self.time_ticket()}
        self.DeclareVectorOutputPort(
            "generalized_force", num_velocities, self._calc_force, prerequisites
        )
        self.DeclareVectorOutputPort("chi", 6, self._calc_chi, prerequisites)

    def _motion(self, context) -> Motion:
        given = (context.get_time(), self._x_port.Eval(context), self._thrust_port.Eval(context))
        if self._reads_rate and self._rate_port.HasValue(context):
            return Motion(*given, rotor_rate=self._rate_port.Eval(context))
        return Motion(*given)

    def _calc_force(self, context, output) -> None:
        motion = self._motion(context)
        generalized_force(motion.x, self._total(motion), self._force)
        output.SetFromVector(self._force)

    def _calc_chi(self, context, output) -> None:
        output.SetFromVector(self._total(self._motion(context)))

    def _total(self, motion: Motion) -> np.ndarray:
        return total_wrench(
            self._vehicle, acting(self._effects, self._onsets, float(motion.t)), motion
        )


@compiled
def generalized_force(x, chi, out):
    """Write [moment in W, force in W] of a wrench to out[:6].

    Args:
        x: (13,) state, whose attitude counts.
        chi: (6,) [N, N·m].
        out: at least six.
    """
    out[0], out[1], out[2] = turned(x[3], x[4], x[5], x[6], chi[3], chi[4], chi[5])
    out[3], out[4], out[5] = chi[0], chi[1], chi[2]
