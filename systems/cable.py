"""A tension-only tether between quadrotor and payload."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import LeafSystem

from np_drake import attitude
from np_drake.compiled import compiled, turned
from systems.plant import declare_event_at, places_of_pair, setting


class Cable(LeafSystem):
    """Spring-damper along the line from the hook to the payload, which pulls and never pushes.

    T = max(0, k (l - L) + c dl/dt) for l > L, else 0.
    Source: own choice; k and c keep a taut flight within 0.01 mm of a rod.

    .. pydrake_system::

        name: Cable
        input_ports:
        - plant_state
        output_ports:
        - generalized_force
        - tether_wrench
        - holds

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | nq + nv | Drake's order | |
    | generalized_force | nv | [moment about Bo, force] on B, then on P, all in W | N·m, N |
    | tether_wrench | 6 | chi order: [force on B in W, moment about Bo in B] | N, N·m |
    | holds | 1 | the state | |

    State: 1 while the cable holds, 0 before and after. Events: at `tied_at` and `cut_at`.
    line: hook (3,), length, stiffness and damping, in the order of `cable_force`.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        *,
        length: float,
        hook,
        stiffness: float = 2.0e4,
        damping: float = 40.0,
        tied_at: float = 0.0,
        cut_at: float = np.inf,
    ):
        """Declare ports, state and events.

        Args:
            plant: with the free bodies `quadrotor` and `payload`.
            length: L [m].
            hook: (3,) p_BoTo_B [m].
            stiffness: k [N/m].
            damping: c [N·s/m].
            tied_at: time from which the payload hangs on the cable; 0 from the start [s].
            cut_at: time at which the cable is cut [s].
        """
        super().__init__()
        self.line = np.array(hook, float), float(length), float(stiffness), float(damping)
        q, self._velocities = places_of_pair(plant)
        self._rows = np.concatenate([q, plant.num_positions() + self._velocities])
        size = plant.num_velocities()
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        holds = self.DeclareDiscreteState([float(tied_at <= 0.0)])
        prerequisites = {self._state_port.ticket(), self.xd_ticket()}
        self.DeclareVectorOutputPort("generalized_force", size, self._calc_force, prerequisites)
        self.DeclareVectorOutputPort("tether_wrench", 6, self._calc_wrench, prerequisites)
        self.DeclareStateOutputPort("holds", holds)
        declare_event_at(self, tied_at, setting(1.0))
        declare_event_at(self, cut_at, setting(0.0))

    def _pull(self, context, state) -> np.ndarray:
        """Return the generalized force (12,) on the pair.

        Args:
            state: (26,) of the pair: [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP].
        """
        force = np.zeros(12)
        if context.get_discrete_state(0).GetAtIndex(0):
            cable_force(state, *self.line, force)
        return force

    def _calc_force(self, context, output) -> None:
        force = np.zeros(output.size())
        force[self._velocities] = self._pull(context, self._state_port.Eval(context)[self._rows])
        output.SetFromVector(force)

    def _calc_wrench(self, context, output) -> None:
        state = self._state_port.Eval(context)[self._rows]
        force = self._pull(context, state)
        turned_back = attitude.rotate_back(state[0:4], force[0:3])
        output.SetFromVector(np.concatenate([force[3:6], turned_back]))


@compiled
def cable_force(s, hook, length, stiffness, damping, out):
    """Write the generalized force of a taut cable to out (12,), which comes zeroed.

    Args:
        s: (26,) [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP] of the plant.
        hook: (3,) p_BoTo_B [m].
        length: unstretched [m].
        stiffness: [N/m].
        damping: [N·s/m].
        out: (12,) to be written [N·m, N].
    """
    r_x, r_y, r_z = turned(s[0], s[1], s[2], s[3], hook[0], hook[1], hook[2])
    d_x, d_y, d_z = s[11] - s[4] - r_x, s[12] - s[5] - r_y, s[13] - s[6] - r_z
    span = math.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
    if span <= length:
        return
    w_x, w_y, w_z = s[14], s[15], s[16]
    u_x = s[23] - s[17] - (w_y * r_z - w_z * r_y)
    u_y = s[24] - s[18] - (w_z * r_x - w_x * r_z)
    u_z = s[25] - s[19] - (w_x * r_y - w_y * r_x)
    rate = (d_x * u_x + d_y * u_y + d_z * u_z) / span
    tension = stiffness * (span - length) + damping * rate
    if tension <= 0.0:
        return
    f_x, f_y, f_z = tension * d_x / span, tension * d_y / span, tension * d_z / span
    out[0], out[1], out[2] = r_y * f_z - r_z * f_y, r_z * f_x - r_x * f_z, r_x * f_y - r_y * f_x
    out[3], out[4], out[5] = f_x, f_y, f_z
    out[9], out[10], out[11] = -f_x, -f_y, -f_z
