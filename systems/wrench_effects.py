"""Forces from outside: effects as force and torque on the body, and what a port brings."""

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from np_drake.effects.base import Motion, WrenchEffect
from np_drake.effects.combine import NO_ONSETS, Onsets, acting, require_complete, total_wrench
from np_drake.vehicle import Vehicle

WRENCH = "external_wrench"  # port of a wrench from outside on the vehicle
PUSH = "payload_force"  # port of a force from outside on the payload


class WrenchEffects(LeafSystem):
    """Sum of the wrenches of all given effects on the body.

    .. pydrake_system::

        name: WrenchEffects
        input_ports:
        - x
        - rotor_thrust
        - rotor_rate (optional)
        - nominal_thrust (optional)
        output_ports:
        - generalized_force

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | true state | |
    | rotor_thrust | 4 | actual rotor thrust | N |
    | rotor_rate | 4 | time derivative of rotor speed; zero where not connected | rad/s² |
    | nominal_thrust | 4 | of nominal rotors at that speed; rotor_thrust where not connected | N |
    | generalized_force | nv | [moment about Bo, force] on B in W, zeros for other bodies | N·m, N |
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
        self._vehicle = vehicle
        self._effects = list(effects)
        self._onsets = onsets
        self._size = num_velocities
        self._x_port = self.DeclareVectorInputPort("x", 13)
        self._thrust_port = self.DeclareVectorInputPort("rotor_thrust", 4)
        self._optional = {
            name: self.DeclareVectorInputPort(name, 4) for name in ("rotor_rate", "nominal_thrust")
        }
        prerequisites = {self.all_input_ports_ticket(), self.time_ticket()}
        self.DeclareVectorOutputPort(
            "generalized_force", num_velocities, self._calc_force, prerequisites
        )

    def _calc_force(self, context, output) -> None:
        given = (context.get_time(), self._x_port.Eval(context), self._thrust_port.Eval(context))
        ports = self._optional.items()
        motion = Motion(*given, **{n: p.Eval(context) for n, p in ports if p.HasValue(context)})
        effects = acting(self._effects, self._onsets, float(motion.t))
        chi = total_wrench(self._vehicle, effects, motion)
        force = np.zeros(self._size)
        force[:3] = motion.R_WB @ chi[3:]
        force[3:6] = chi[:3]
        output.SetFromVector(force)


class ExternalForces(LeafSystem):
    """Forces of systems of one's own on quadrotor and payload; an unconnected port brings none.

    .. pydrake_system::

        name: ExternalForces
        input_ports:
        - plant_state
        - external_wrench (optional)
        - payload_force (optional)
        output_ports:
        - generalized_force

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | nq + nv | Drake's order | |
    | external_wrench | 6 | chi order: [force at Bo in W, torque in B] | N, N·m |
    | payload_force | 3 | at the payload's origin, in W (with a payload only) | N |
    | generalized_force | nv | the sum of J' [torque in W, force in W] of both | N·m, N |

    Args:
        plant: finalized, with the body `quadrotor`.
    """

    def __init__(self, plant: MultibodyPlant):
        super().__init__()
        self._plant = plant
        self._workspace = plant.CreateDefaultContext()
        self._forces = MultibodyForces(plant)
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        bodies = {"quadrotor": (WRENCH, 6), "payload": (PUSH, 3)}
        self._pushed = [
            (plant.GetBodyByName(name), self.DeclareVectorInputPort(*port))
            for name, port in bodies.items()
            if plant.HasBodyNamed(name)
        ]
        self.DeclareVectorOutputPort(
            "generalized_force",
            plant.num_velocities(),
            self._calc_force,
            {self.all_input_ports_ticket()},
        )

    def _calc_force(self, context, output) -> None:
        plant = self._plant
        workspace = self._workspace
        forces = self._forces
        forces.SetZero()
        for body, port in self._pushed:
            if port.HasValue(context):
                plant.SetPositionsAndVelocities(workspace, self._state_port.Eval(context))
                pushed = np.zeros(6)
                pushed[: port.size()] = port.Eval(context)
                torque = plant.EvalBodyPoseInWorld(workspace, body).rotation() @ pushed[3:]
                body.AddInForceInWorld(workspace, SpatialForce(torque, pushed[:3]), forces)
        output.SetFromVector(plant.CalcGeneralizedForces(workspace, forces))


def export_pushes(builder: DiagramBuilder, system: LeafSystem) -> None:
    """Export the ports of a system that forces from outside come by."""
    for i in range(system.num_input_ports()):
        port = system.get_input_port(i)
        if port.get_name() in (WRENCH, PUSH):
            builder.ExportInput(port, port.get_name())
