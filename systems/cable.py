"""A tension-only tether between quadrotor and payload, without mass or with."""

import math

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import BasicVector, LeafSystem

from np_drake import attitude
from np_drake.compiled import compiled, turned
from systems.payload_config import PayloadConfig
from systems.plant import declare_event_at, setting


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
    line: hook (3,) and pieces (n + 1, 3), in the order of `cable_force`.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        payload: PayloadConfig,
        *,
        tied_at: float = 0.0,
        cut_at: float = np.inf,
    ):
        """Declare ports, state and events.

        Args:
            plant: with the free bodies `quadrotor` and `payload`.
            payload: that hangs on the cable.
            tied_at: time from which the payload hangs on the cable; 0 from the start [s].
            cut_at: time at which the cable is cut at the hook [s].
        """
        super().__init__()
        self.line = np.array(payload.hook, float), payload.pieces
        # where the pair stands in the plant's velocities and state, whatever other bodies there are
        pair = [plant.GetJointByName(name) for name in ("quadrotor", "payload")]
        q = np.concatenate([joint.position_start() + np.arange(7) for joint in pair])
        self._velocities = np.concatenate([j.velocity_start() + np.arange(6) for j in pair])
        self._rows = np.concatenate([q, plant.num_positions() + self._velocities])
        size = plant.num_velocities()
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        holds = self.DeclareDiscreteState([float(tied_at <= 0.0)])
        prerequisites = {self.all_input_ports_ticket(), self.all_state_ticket()}
        self.DeclareVectorOutputPort("generalized_force", size, self._calc_force, prerequisites)
        self.DeclareVectorOutputPort("tether_wrench", 6, self._calc_wrench, prerequisites)
        self.DeclareStateOutputPort("holds", holds)
        declare_event_at(self, tied_at, setting(1.0))
        declare_event_at(self, cut_at, setting(0.0))

    def _pulls(self, context) -> tuple[np.ndarray, ...]:
        """Return the state of the pair (26,), [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP]; that of the
        point masses (n, 6), if any; the generalized force (12,) on the pair, and that on them.
        """
        state = self._state_port.Eval(context)[self._rows]
        nodes = context.get_continuous_state_vector().CopyToVector().reshape(-1, 6)
        force = np.zeros(12)
        pulls = np.zeros((len(nodes), 3))
        holds = context.get_discrete_state(0).GetAtIndex(0)
        cable_force(state, nodes, holds, *self.line, force, pulls)
        return state, nodes, force, pulls

    def _calc_force(self, context, output) -> None:
        force = np.zeros(output.size())
        force[self._velocities] = self._pulls(context)[2]
        output.SetFromVector(force)

    def _calc_wrench(self, context, output) -> None:
        state, _, force, _ = self._pulls(context)
        moment = attitude.rotate_back(state[0:4], force[0:3])
        output.SetFromVector(np.concatenate([force[3:6], moment]))


class Rope(Cable):
    """Cable with mass and drag: point masses in the middle of equal parts, on the cable's law.

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

    Continuous state: [place from Bo in W, velocity in W] of each point mass; it begins hanging at
    rest under a level quadrotor. All else as of `Cable`, arguments too.
    """

    def __init__(self, plant: MultibodyPlant, payload: PayloadConfig, **events: float):
        super().__init__(plant, payload, **events)
        n = payload.segments
        M = payload.rope_mass
        self._mass = M / n
        self._brake = payload.rope_air_damping
        self._gravity = plant.gravity_field().gravity_vector()
        below = payload.mass + M * (1.0 - np.arange(n) / n)
        length, stiffness, _ = payload.pieces[:-1].T
        drop = np.cumsum(length - below * self._gravity[2] / stiffness)
        rest = np.hstack([payload.hook - drop[:, None] * [0, 0, 1], np.zeros((n, 3))])
        self.DeclareContinuousState(BasicVector(rest.ravel()))
        self.DeclareVectorOutputPort("rope", 3 * n, self._calc_rope)

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Write velocities and accelerations of the point masses."""
        state, nodes, _, pulls = self._pulls(context)
        v = nodes[:, 3:]
        a = pulls / self._mass - self._brake * v + self._gravity
        derivatives.SetFromVector(np.hstack([v - state[17:20], a]).ravel())

    def _calc_rope(self, context, output) -> None:
        state, nodes, *_ = self._pulls(context)
        output.SetFromVector((state[4:7] + nodes[:, :3]).ravel())


@compiled
def cable_force(s, nodes, holds, hook, pieces, out, pulls):
    """Write what a cable does to quadrotor and payload, and to its own point masses, if any.

    Args:
        s: (26,) [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP] of the plant.
        nodes: (n, 6) [place from Bo, velocity] of the point masses, in W.
        holds: whether the hook holds it, 0 or 1.
        hook: (3,) p_BoTo_B [m].
        pieces: (n + 1, 3) unstretched length, stiffness and damping between them, from the hook
            on [m, N/m, N·s/m].
        out: (12,) generalized force on the pair, which comes zeroed [N·m, N].
        pulls: (n, 3) force on each point mass, which comes zeroed [N].
    """
    n = len(nodes)
    here = np.empty(6)
    there = np.empty(6)
    f = np.zeros(3)
    r_x, r_y, r_z = turned(s[0], s[1], s[2], s[3], hook[0], hook[1], hook[2])
    w_x = s[14]
    w_y = s[15]
    w_z = s[16]
    here[0] = r_x
    here[1] = r_y
    here[2] = r_z
    # velocities are those seen from Bo
    here[3] = w_y * r_z - w_z * r_y
    here[4] = w_z * r_x - w_x * r_z
    here[5] = w_x * r_y - w_y * r_x
    for i in range(n + 1):
        for k in range(3):
            there[k] = nodes[i, k] if i < n else s[11 + k] - s[4 + k]
            there[3 + k] = (nodes[i, 3 + k] if i < n else s[23 + k]) - s[17 + k]
        if i > 0 or holds:
            _pull(here, there, pieces[i], f)
        for k in range(3):
            here[k] = there[k]
            here[3 + k] = there[3 + k]
            if i == 0:
                out[3 + k] = f[k]
            else:
                pulls[i - 1, k] += f[k]
            if i == n:
                out[9 + k] = -f[k]
            else:
                pulls[i, k] -= f[k]
    f_x = out[3]
    f_y = out[4]
    f_z = out[5]
    out[0] = r_y * f_z - r_z * f_y
    out[1] = r_z * f_x - r_x * f_z
    out[2] = r_x * f_y - r_y * f_x


@compiled
def _pull(here, there, piece, f):
    """Write the force of a piece of cable on its end `here`, zero of a slack piece.

    Args:
        here: (6,) place and velocity [m, m/s].
        there: (6,) those of its other end.
        piece: (3,) as of `cable_force`.
        f: (3,) to be written [N].
    """
    d_x = there[0] - here[0]
    d_y = there[1] - here[1]
    d_z = there[2] - here[2]
    u_x = there[3] - here[3]
    u_y = there[4] - here[4]
    u_z = there[5] - here[5]
    span = math.sqrt(d_x * d_x + d_y * d_y + d_z * d_z)
    f[0] = 0.0
    f[1] = 0.0
    f[2] = 0.0
    if span > piece[0]:
        rate = (d_x * u_x + d_y * u_y + d_z * u_z) / span
        tension = max(piece[1] * (span - piece[0]) + piece[2] * rate, 0.0)
        f[0] = tension * d_x / span
        f[1] = tension * d_y / span
        f[2] = tension * d_z / span
