"""A force from outside on the quadrotor and on its payload."""

import numpy as np
from pydrake.systems.framework import BasicVector, LeafSystem


class Push(LeafSystem):
    """Force at Bo and, where a payload is a free body, at Po, each constant until it is set anew.

    .. pydrake_system::

        name: Push
        output_ports:
        - generalized_force

    | port | size | meaning | unit |
    |---|---|---|---|
    | generalized_force | nv | [moment, force] on B, then on P, all in W; zeros for other joints | N·m, N |

    Parameter: the forces (6,) on B and P in W [N], zero at the start.
    """  # noqa: E501

    def __init__(self, num_velocities: int, *, payload: bool):
        """Declare port and parameter.

        Args:
            num_velocities: nv of the plant [1].
            payload: whether velocities 6 to 11 are those of a payload.
        """
        super().__init__()
        self._size, self._payload = num_velocities, payload
        self.DeclareNumericParameter(BasicVector(np.zeros(6)))
        prerequisites = {self.all_parameters_ticket()}
        self.DeclareVectorOutputPort(
            "generalized_force", num_velocities, self._calc_force, prerequisites
        )

    def set_force(self, context, vehicle: np.ndarray, payload: np.ndarray) -> None:
        """Set the forces between two AdvanceTo.

        Args:
            context: the push's own.
            vehicle: (3,) force at Bo in W [N].
            payload: (3,) force at Po in W [N].
        Raises: ValueError: on a force on a payload that there is not.
        """
        if np.any(payload) and not self._payload:
            raise ValueError(
                f"Push: there must be a payload on a cable to be pushed; got {payload} N on none."
            )
        context.get_mutable_numeric_parameter(0).SetFromVector(np.concatenate([vehicle, payload]))

    def _calc_force(self, context, output) -> None:
        forces = context.get_numeric_parameter(0).get_value()
        total = np.zeros(self._size)
        total[3:6] = forces[:3]
        if self._payload:
            total[9:12] = forces[3:]
        output.SetFromVector(total)
