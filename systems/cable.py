"""A tension-only tether between quadrotor and payload, without mass or with."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake import attitude
from np_drake.compiled import compiled, turned
from systems.payload_config import PayloadConfig
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
        prerequisites = {self._state_port.ticket(), self.all_state_ticket()}
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


class Rope(Cable):
    """Cable with mass and drag: point masses in the middle of equal pieces, on the cable's law.

    Each piece is as stiff as its share of the cable, and as damped as cable and payload.
    Source: own choice; the first modes of a uniform chain err by 0.4 % with 20 of them.

    .. pydrake_system::

        name: Rope
        input_ports:
        - plant_state
        output_ports:
        - generalized_force
        - tether_wrench
        - holds
        - rope

    | port | size | meaning | unit |
    |---|---|---|---|
    | rope | 3 n | places of the point masses in W, from the hook down | m |

    The other ports and events are those of `Cable`.
    Continuous state: [place from Bo in W, velocity in W] of each point mass; it begins hanging at
    rest under a level quadrotor.
    """

    def __init__(self, plant: MultibodyPlant, payload: PayloadConfig, *, cut_at: float = np.inf):
        """Declare ports, state and events.

        Args:
            plant: with the free bodies `quadrotor` and `payload`.
            payload: that hangs on it.
            cut_at: time at which it is cut at the hook [s].
        """
        super().__init__(
            plant,
            length=payload.length,
            hook=payload.hook,
            stiffness=payload.stiffness,
            damping=payload.piece_damping,
            cut_at=cut_at,
        )
        self._mass, self._brake = payload.rope_mass / payload.segments, payload.rope_air_damping
        self._gravity = plant.gravity_field().gravity_vector()
        n, M = payload.segments, payload.rope_mass
        share = (np.arange(n) + 0.5) / n
        # stretched by the weight below each
        carried = (payload.mass + M) * share - 0.5 * M * (share**2 - 0.25 / n**2)
        rest = np.zeros((n, 6))
        rest[:, :3] = payload.hook
        rest[:, 2] += carried * self._gravity[2] / payload.stiffness - payload.length * share
        self.DeclareContinuousState(BasicVector(rest.ravel()))
        self.DeclareVectorOutputPort("rope", 3 * n, self._calc_rope)

    def _nodes(self, context) -> np.ndarray:
        return context.get_continuous_state_vector().CopyToVector().reshape(-1, 6)

    def _pulls(self, context, state) -> tuple[np.ndarray, np.ndarray]:
        """Return the generalized force (12,) on the pair, and the force on each point mass."""
        nodes, force = self._nodes(context), np.zeros(12)
        pulls, holds = np.zeros((len(nodes), 3)), context.get_discrete_state(0).GetAtIndex(0)
        rope_force(state, nodes, holds, *self.line, force, pulls)
        return force, pulls

    def _pull(self, context, state) -> np.ndarray:
        return self._pulls(context, state)[0]

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Write velocities and accelerations of the point masses."""
        state, nodes = self._state_port.Eval(context)[self._rows], self._nodes(context)
        _, pulls = self._pulls(context, state)
        v = nodes[:, 3:]
        a = pulls / self._mass - self._brake * v + self._gravity
        derivatives.SetFromVector(np.hstack([v - state[17:20], a]).ravel())

    def _calc_rope(self, context, output) -> None:
        state = self._state_port.Eval(context)[self._rows]
        output.SetFromVector((state[4:7] + self._nodes(context)[:, :3]).ravel())


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
    w_x, w_y, w_z = s[14], s[15], s[16]
    u_x = s[23] - s[17] - (w_y * r_z - w_z * r_y)
    u_y = s[24] - s[18] - (w_z * r_x - w_x * r_z)
    u_z = s[25] - s[19] - (w_x * r_y - w_y * r_x)
    f_x, f_y, f_z = _pull(d_x, d_y, d_z, u_x, u_y, u_z, length, stiffness, damping)
    out[0], out[1], out[2] = r_y * f_z - r_z * f_y, r_z * f_x - r_x * f_z, r_x * f_y - r_y * f_x
    out[3], out[4], out[5] = f_x, f_y, f_z
    out[9], out[10], out[11] = -f_x, -f_y, -f_z


@compiled
def _pull(d_x, d_y, d_z, u_x, u_y, u_z, length, stiffness, damping):
    """Return the force that a piece of cable exerts on its one end, zero of a slack one; d points
    to the other end, which moves by u as seen from the one.
    """
    span = math.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
    if span <= length:
        return 0.0, 0.0, 0.0
    rate = (d_x * u_x + d_y * u_y + d_z * u_z) / span
    tension = stiffness * (span - length) + damping * rate
    if tension <= 0.0:
        return 0.0, 0.0, 0.0
    return tension * d_x / span, tension * d_y / span, tension * d_z / span


@compiled
def rope_force(s, nodes, holds, hook, length, stiffness, damping, out, pulls):
    """Write what a rope does to quadrotor and payload, and to its own point masses.

    Args:
        s: as of `cable_force`, like all that is not named here.
        nodes: (n, 6) [place from Bo, velocity] of the point masses, in W.
        holds: whether the hook holds it, 0 or 1.
        hook: (3,).
        length: of the whole rope.
        stiffness: of the whole rope.
        damping: of a piece.
        out: (12,), which comes zeroed.
        pulls: (n, 3) force on each point mass, which comes zeroed [N].
    """
    n, here, there, f = len(nodes), np.empty(6), np.empty(6), np.empty(3)
    r_x, r_y, r_z = turned(s[0], s[1], s[2], s[3], hook[0], hook[1], hook[2])
    here[0], here[1], here[2] = r_x, r_y, r_z
    here[3] = s[17] + s[15] * r_z - s[16] * r_y
    here[4] = s[18] + s[16] * r_x - s[14] * r_z
    here[5] = s[19] + s[14] * r_y - s[15] * r_x
    for i in range(n + 1):
        for k in range(3):
            there[k] = nodes[i, k] if i < n else s[11 + k] - s[4 + k]
            there[3 + k] = nodes[i, 3 + k] if i < n else s[23 + k]
        piece = length / n if 0 < i < n else 0.5 * length / n
        d = there - here
        f[0], f[1], f[2] = _pull(
            d[0], d[1], d[2], d[3], d[4], d[5], piece, stiffness * length / piece, damping
        )
        for k in range(3):
            if i == 0:
                f[k] *= holds
                out[3 + k] = f[k]
            else:
                pulls[i - 1, k] += f[k]
            if i == n:
                out[9 + k] = -f[k]
            else:
                pulls[i, k] -= f[k]
            here[k], here[3 + k] = there[k], there[3 + k]
    out[0] = r_y * out[5] - r_z * out[4]
    out[1] = r_z * out[3] - r_x * out[5]
    out[2] = r_x * out[4] - r_y * out[3]
