"""Conversion of the plant's outputs to the project's state, acceleration and wrench vectors."""

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import LeafSystem

from np_drake import attitude
from np_drake.compiled import compiled, turned


@compiled
def vehicle_state(s, q_start, v_start, out):
    """Write x (13,) from the plant's state.

    Args:
        s: (nq + nv,) state of the plant.
        q_start: place of the body's pose in it.
        v_start: place of its velocity.
        out: (13,) to be written.
    """
    for k in range(3):
        out[k] = s[q_start + 4 + k]
        out[7 + k] = s[v_start + 3 + k]
    w = s[q_start]
    x = s[q_start + 1]
    y = s[q_start + 2]
    z = s[q_start + 3]
    out[3] = w
    out[4] = x
    out[5] = y
    out[6] = z
    out[10], out[11], out[12] = turned(w, -x, -y, -z, s[v_start], s[v_start + 1], s[v_start + 2])


class VehicleState(LeafSystem):
    """Conversion of the plant state to the state x.

    .. pydrake_system::

        name: VehicleState
        input_ports:
        - plant_state
        output_ports:
        - x

    | port | size | meaning |
    |---|---|---|
    | plant_state | nq + nv | Drake's order: quaternion, position, w_WB, v_WB (both in W) |
    | x | 13 | [p_WB, q_WB, v_WB, w_WB_B] |

    Args:
        plant: whose state is read, with a floating joint `quadrotor`.
    """

    def __init__(self, plant: MultibodyPlant):
        super().__init__()
        joint = plant.GetJointByName("quadrotor")
        self._starts = joint.position_start(), plant.num_positions() + joint.velocity_start()
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        self.DeclareVectorOutputPort("x", 13, self._calc_x, {self.all_input_ports_ticket()})

    def _calc_x(self, context, output) -> None:
        x = np.empty(13)
        vehicle_state(self._state_port.Eval(context), *self._starts, x)
        output.SetFromVector(x)


class BodyAcceleration(LeafSystem):
    """Spatial acceleration of the quadrotor as [a in W, al in B].

    .. pydrake_system::

        name: BodyAcceleration
        input_ports:
        - plant_state
        - generalized_acceleration
        output_ports:
        - acceleration

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | nq + nv | Drake's order: quaternion, position, w_WB, v_WB (both in W) | |
    | generalized_acceleration | nv | time derivative of the plant's velocities | rad/s², m/s² |
    | acceleration | 6 | [dv_WB/dt in W, dw_WB_B/dt in B] | m/s², rad/s² |

    Args:
        plant: whose state is read, with a floating joint `quadrotor`.
    """

    def __init__(self, plant: MultibodyPlant):
        super().__init__()
        joint = plant.GetJointByName("quadrotor")
        self._starts = joint.position_start(), joint.velocity_start()
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        self._rates_port = self.DeclareVectorInputPort(
            "generalized_acceleration", plant.num_velocities()
        )
        inputs = {self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("acceleration", 6, self._calc_acceleration, inputs)

    def _calc_acceleration(self, context, output) -> None:
        q_start, v_start = self._starts
        q = self._state_port.Eval(context)[q_start : q_start + 4]
        al, a = np.split(self._rates_port.Eval(context)[v_start : v_start + 6], 2)
        output.SetFromVector(np.concatenate([a, attitude.rotate_back(q, al)]))


class RodWrench(LeafSystem):
    """True wrench of the rod on the quadrotor, from the joint's reaction force.

    .. pydrake_system::

        name: RodWrench
        input_ports:
        - reaction_forces
        - body_poses
        output_ports:
        - tether_wrench

    | port | size | meaning | unit |
    |---|---|---|---|
    | reaction_forces | list | the plant's F on the child at the joint, in the joint's frame on the child | |
    | body_poses | list | the plant's X_WB of every body | |
    | tether_wrench | 6 | chi order: [force on B in W, moment about Bo in B] | N, N·m |

    Args:
        plant: finalized.
        joint: name of the rod's joint.
    """  # noqa: E501

    def __init__(self, plant: MultibodyPlant, joint: str):
        super().__init__()
        rod = plant.GetJointByName(joint)
        self._ordinal = plant.GetJointIndices().index(rod.index())
        self._parent = int(rod.parent_body().index())
        self._child = int(rod.child_body().index())
        self._X_PM = rod.frame_on_child().GetFixedPoseInBodyFrame()
        self._p_BoTo_B = rod.frame_on_parent().GetFixedPoseInBodyFrame().translation()
        self._forces_port = self.DeclareAbstractInputPort(
            "reaction_forces", Value[list[SpatialForce]]()
        )
        self._poses_port = self.DeclareAbstractInputPort(
            "body_poses", Value[list[RigidTransform]]()
        )
        inputs = {self.all_input_ports_ticket()}
        self.DeclareVectorOutputPort("tether_wrench", 6, self._calc_wrench, inputs)

    def _calc_wrench(self, context, output) -> None:
        F_PM_M = self._forces_port.Eval(context)[self._ordinal]
        poses = self._poses_port.Eval(context)
        R_WM = (poses[self._child] @ self._X_PM).rotation()
        R_WB = poses[self._parent].rotation()
        f_B_W = -(R_WM @ F_PM_M.translational())
        tau_B = -(R_WB.inverse() @ (R_WM @ F_PM_M.rotational()))
        tau_B = tau_B + np.cross(self._p_BoTo_B, R_WB.inverse() @ f_B_W)
        output.SetFromVector(np.concatenate([f_B_W, tau_B]))
