"""A tension-only tether between quadrotor and payload."""

import math

from pydrake.systems.framework import BasicVector, LeafSystem


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

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | 26 | [q_WB, p_WB, q_WP, p_WP, V_WB, V_WP], Drake's order | |
    | generalized_force | 12 | [moment about Bo, force on B, moment, force on P], all in W | N·m, N |
    | tether_wrench | 6 | chi order: [force on B in W, moment about Bo in B] | N, N·m |

    Parameter: 1 while the cable holds, 0 before it is tied (`tie`) and once it is cut (`cut`).
    """

    def __init__(
        self, *, length: float, hook, stiffness: float = 2.0e4, damping: float = 40.0, tied: bool = True
    ):
        """Declare ports and parameter.

        Args: length: L [m].   hook: (3,) p_BoTo_B [m].   stiffness: k [N/m].   damping: c [N·s/m].
        tied: at the start.
        """
        super().__init__()
        self._length, self._hook = float(length), tuple(float(h) for h in hook)
        self._stiffness, self._damping = float(stiffness), float(damping)
        self._state_port = self.DeclareVectorInputPort("plant_state", 26)
        self.DeclareNumericParameter(BasicVector([float(tied)]))
        prerequisites = {self._state_port.ticket(), self.all_parameters_ticket()}
        self.DeclareVectorOutputPort("generalized_force", 12, self._calc_force, prerequisites)
        self.DeclareVectorOutputPort("tether_wrench", 6, self._calc_wrench, prerequisites)

    def tie(self, context) -> None:
        """Tie the payload on, between two AdvanceTo; `context` is the cable's own."""
        context.get_mutable_numeric_parameter(0).SetAtIndex(0, 1.0)

    def cut(self, context) -> None:
        """Cut the cable for good, between two AdvanceTo; `context` is the cable's own."""
        context.get_mutable_numeric_parameter(0).SetAtIndex(0, 0.0)

    def _pull(self, context) -> tuple[list[float], list[float], list[float]]:
        """Return force on B in W, moment about Bo in W, and the state as a list, in plain floats for speed."""
        s = self._state_port.Eval(context).tolist()
        w, x, y, z = s[0:4]
        hx, hy, hz = self._hook
        # p_BoTo_W = R_WB p_BoTo_B
        cx, cy, cz = y * hz - z * hy, z * hx - x * hz, x * hy - y * hx
        rx = hx + 2 * (w * cx + y * cz - z * cy)
        ry = hy + 2 * (w * cy + z * cx - x * cz)
        rz = hz + 2 * (w * cz + x * cy - y * cx)
        dx, dy, dz = s[11] - s[4] - rx, s[12] - s[5] - ry, s[13] - s[6] - rz
        span = math.sqrt(dx * dx + dy * dy + dz * dz)
        if span <= self._length or not context.get_numeric_parameter(0).GetAtIndex(0):
            return [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], s
        wx, wy, wz = s[14:17]
        ux = s[23] - s[17] - (wy * rz - wz * ry)
        uy = s[24] - s[18] - (wz * rx - wx * rz)
        uz = s[25] - s[19] - (wx * ry - wy * rx)
        rate = (dx * ux + dy * uy + dz * uz) / span
        tension = self._stiffness * (span - self._length) + self._damping * rate
        if tension <= 0.0:
            return [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], s
        tension /= span
        fx, fy, fz = tension * dx, tension * dy, tension * dz
        return [fx, fy, fz], [ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx], s

    def _calc_force(self, context, output) -> None:
        f, m, _ = self._pull(context)
        output.SetFromVector([*m, *f, 0.0, 0.0, 0.0, -f[0], -f[1], -f[2]])

    def _calc_wrench(self, context, output) -> None:
        f, _, s = self._pull(context)
        w, x, y, z = s[0], -s[1], -s[2], -s[3]
        gx, gy, gz = f
        cx, cy, cz = y * gz - z * gy, z * gx - x * gz, x * gy - y * gx
        fx = gx + 2 * (w * cx + y * cz - z * cy)
        fy = gy + 2 * (w * cy + z * cx - x * cz)
        fz = gz + 2 * (w * cz + x * cy - y * cx)
        hx, hy, hz = self._hook
        output.SetFromVector([*f, hy * fz - hz * fy, hz * fx - hx * fz, hx * fy - hy * fx])
