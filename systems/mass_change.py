"""Change of mass properties in flight, as the force that makes a plant of constant mass move
accordingly.
"""

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.framework import Context, LeafSystem

from np_drake import attitude
from np_drake.vehicle import Vehicle
from systems.plant import declare_event_at, setting

# Time [s], and what sets the mass properties in a context
Change = tuple[float, Callable[[MultibodyPlant, Context], None]]


class MassChange(LeafSystem):
    """Applied force under which the plant accelerates as it would with the mass properties of now.

    The masses of a plant are parameters, which no event may change. With M and b of the plant's own
    mass properties, M_now and b_now of those of now, and the force tau that acts:
        M_now dv/dt + b_now = tau,   M dv/dt + b = tau + correction.
    Source: own choice; inverse dynamics of the acceleration that is wanted.

    .. pydrake_system::

        name: MassChange
        input_ports:
        - plant_state
        - generalized_force
        - rotor_thrust
        output_ports:
        - generalized_force

    | port | size | meaning | unit |
    |---|---|---|---|
    | plant_state | nq + nv | Drake's order | |
    | generalized_force (in) | nv | what acts, without gravity and propellers | N·m, N |
    | rotor_thrust | 4 | of propellers, which the plant gets besides; unconnected: there are none | N |
    | generalized_force (out) | nv | to be applied; the same as what comes in before the first change | N·m, N |

    State: number of changes so far. Events: one at the time of each change.
    """  # noqa: E501

    def __init__(self, plant: MultibodyPlant, vehicle: Vehicle, changes: Sequence[Change]):
        """Declare ports, state and events.

        Args:
            plant: finalized; the first six velocities are those of the quadrotor.
            vehicle: places of the rotors.
            changes: by time; each keeps what those before it set.
        """
        super().__init__()
        self._plant = plant
        self._vehicle = vehicle
        self._forces = MultibodyForces(plant)
        # workspace: the state is set before each use
        self._contexts = [plant.CreateDefaultContext()]
        size = plant.num_velocities()
        self._state_port = self.DeclareVectorInputPort("plant_state", plant.num_multibody_states())
        self._force_port = self.DeclareVectorInputPort("generalized_force", size)
        self._thrust_port = self.DeclareVectorInputPort("rotor_thrust", 4)
        self.DeclareDiscreteState([0.0])
        prerequisites = {self.all_input_ports_ticket(), self.xd_ticket()}
        self.DeclareVectorOutputPort("generalized_force", size, self._calc_force, prerequisites)
        for count, (time, change) in enumerate(changes, start=1):
            self._contexts.append(self._contexts[-1].Clone())
            change(plant, self._contexts[-1])
            declare_event_at(self, time, setting(float(count)))

    def _calc_force(self, context, output) -> None:
        force = self._force_port.Eval(context)
        count = int(context.get_discrete_state(0).GetAtIndex(0))
        if count:
            state = self._state_port.Eval(context)
            rotors = self._rotor_force(context, state)
            first = self._contexts[0]
            now = self._contexts[count]
            for workspace in (first, now):
                self._plant.SetPositionsAndVelocities(workspace, state)
            # dv/dt = M_now^-1 (tau - b_now); the plant moves so under M dv/dt + b
            bias = self._inverse_dynamics(now, np.zeros(len(force)))
            rates = np.linalg.solve(self._plant.CalcMassMatrix(now), force + rotors - bias)
            force = self._inverse_dynamics(first, rates) - rotors
        output.SetFromVector(force)

    def _inverse_dynamics(self, workspace: Context, rates: np.ndarray) -> np.ndarray:
        """Return the force (nv,) besides gravity and damping under which the plant has these
        `rates` (nv,).
        """
        self._plant.CalcForceElementsContribution(workspace, self._forces)
        return self._plant.CalcInverseDynamics(workspace, rates, self._forces)

    def _rotor_force(self, context: Context, state: np.ndarray) -> np.ndarray:
        """Return the propellers' generalized force (nv,)."""
        force = np.zeros(self._plant.num_velocities())
        if self._thrust_port.HasValue(context):
            u = self._vehicle.mixer @ self._thrust_port.Eval(context)
            # The integrator lets the quaternion drift off the unit sphere.
            R_WB = attitude.rotation_matrix(state[:4] / np.linalg.norm(state[:4]))
            force[:3] = R_WB @ u[1:]
            force[3:6] = R_WB[:, 2] * u[0]
        return force
