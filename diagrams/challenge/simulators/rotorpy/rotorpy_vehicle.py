"""rotorpy's multirotor as a system of Drake, and in the place of Drake's vehicle in this project's
own loop.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    Diagram,
    DiagramBuilder,
    LeafSystem,
    ValueProducer,
)

from diagrams.challenge.simulators.rotorpy.conversion import (
    SPEED,
    Q,
    acceleration_from_rotorpy,
    from_rotorpy,
    rotor_speeds,
    to_rotorpy,
)
from diagrams.challenge.simulators.rotorpy.vehicle import RealMultirotor
from diagrams.loop.reality import RealityConfig, RealVehicle
from np_drake import attitude
from np_drake.effects.base import Effect, MeasurementEffect
from np_drake.vehicle import Vehicle
from systems.command_buffer import SOONEST, CommandBuffer
from systems.payload_event import PayloadEvent

OUTPUTS = ("x", "acceleration", "rotor_thrust", "nominal_rotor_thrust", "plant_state")


class RotorPyVehicle(LeafSystem):
    """Multirotor whose motion is rotorpy's, with a challenge's effects.

    .. pydrake_system::

        name: RotorPyVehicle
        input_ports:
        - u
        output_ports:
        - x
        - acceleration
        - rotor_thrust
        - nominal_rotor_thrust
        - plant_state

    | port | size | meaning | unit |
    |---|---|---|---|
    | u | 4 | [f_u, tau_m] that the rotors get now; saturated in rotor space | N, N·m |
    | x | 13 | true state of Bo [p_WB, q_WB, v_WB, w_WB_B] | |
    | acceleration | 6 | true [dv/dt of Bo in W, dw/dt in B] under the acting command | m/s², rad/s² |
    | rotor_thrust | 4 | thrust of the propellers, far from the ground | N |
    | nominal_rotor_thrust | 4 | what nominal rotors would give at the actual rotor speed | N |
    | plant_state | 13 or 26 | poses, then velocities, of B and of the payload where there is one, in Drake's order | |

    Continuous state: rotorpy's (20,) [of Bcm; wind, which is a function of time; rotor speeds],
    hidden states of effects, payload (6,). It starts in hover over the world origin, under rotors
    that nominally carry all weight.

    Args:
        own: whether rotorpy's own drag, lift and motor lag act beside the effects
            (`RealMultirotor`).
    """  # noqa: E501

    def __init__(
        self, vehicle: Vehicle, effects: Sequence[Effect | MeasurementEffect], *, own: bool = False
    ):
        super().__init__()
        self._vehicle, self._real = vehicle, RealMultirotor(vehicle, effects, own=own)
        self._u_port = self.DeclareVectorInputPort("u", 4)
        resting = self._hovering(np.zeros(3))
        self.DeclareContinuousState(BasicVector(resting))
        prerequisites = {self._u_port.ticket(), self.all_state_ticket(), self.time_ticket()}
        # Derivatives and outputs of one instant read the same rate.
        self._motion = self.DeclareCacheEntry(
            "motion", ValueProducer(allocate=Value[object], calc=self._calc_motion), prerequisites
        )
        state = {self.all_state_ticket()}
        self.DeclareVectorOutputPort("x", 13, self._calc_x, state)
        self.DeclareVectorOutputPort("acceleration", 6, self._calc_acceleration, prerequisites)
        self.DeclareVectorOutputPort("rotor_thrust", 4, self._calc_rotor_thrust, prerequisites)
        self.DeclareVectorOutputPort(
            "nominal_rotor_thrust", 4, self._calc_nominal_thrust, prerequisites
        )
        size = 26 if self._real.payload(resting).size else 13
        self.DeclareVectorOutputPort("plant_state", size, self._calc_plant_state, state)

    @property
    def dead_time(self) -> float:
        """Time by which commands must be held back before they reach `u` [s]."""
        return self._real.dead_time

    @property
    def hover_input(self) -> np.ndarray:
        """Input u (4,) by which nominal rotors carry vehicle and payload [N, N·m]."""
        return np.array([self._real.carried_mass * self._vehicle.gravity, 0.0, 0.0, 0.0])

    def set_hover(self, context: Context, p_WB: np.ndarray) -> None:
        """Set the vehicle level and at rest, a payload hanging still.

        Args:
            p_WB: (3,) place of Bo [m].
        """
        context.SetContinuousState(self._hovering(np.asarray(p_WB, float)))

    def _hovering(self, p_WB: np.ndarray) -> np.ndarray:
        x = np.concatenate([p_WB, [1.0, 0.0, 0.0, 0.0], np.zeros(6)])
        s = to_rotorpy(x, self._real.center, self._speeds(self.hover_input))
        return np.concatenate([s, self._real.hidden_at_rest(0.0, s)])

    def _speeds(self, u: np.ndarray) -> np.ndarray:
        return rotor_speeds(self._vehicle, u, self._vehicle.max_rotor_thrust)

    def _state(self, context) -> np.ndarray:
        """Return the state with a quaternion of unit length.

        Raises: RuntimeError: on a state that is not finite, so that the simulation ends there.
        """
        s = context.get_continuous_state_vector().CopyToVector()
        if not np.isfinite(s).all():
            raise RuntimeError("RotorPyVehicle: the state must be finite.")
        s[Q] /= np.linalg.norm(s[Q])
        return s

    def _calc_motion(self, context, value) -> None:
        """Compute the state and its rate."""
        s, command = self._state(context), self._speeds(self._u_port.Eval(context))
        if not self._real.lags:
            s[SPEED] = command
        value.set_value((s, self._real.rate(context.get_time(), s, command)))

    def DoCalcTimeDerivatives(self, context, derivatives) -> None:
        """Compute the rate of the state, as an override of Drake's virtual."""
        derivatives.SetFromVector(self._motion.Eval(context)[1])

    def _calc_x(self, context, output) -> None:
        output.SetFromVector(from_rotorpy(self._state(context), self._real.center))

    def _calc_acceleration(self, context, output) -> None:
        s, rate = self._motion.Eval(context)
        output.SetFromVector(acceleration_from_rotorpy(s, rate, self._real.center))

    def _calc_rotor_thrust(self, context, output) -> None:
        s, _ = self._motion.Eval(context)
        output.SetFromVector(self._real.thrust(context.get_time(), s[SPEED]))

    def _calc_nominal_thrust(self, context, output) -> None:
        s, _ = self._motion.Eval(context)
        output.SetFromVector(self._vehicle.thrust_coefficient * s[SPEED] ** 2)

    def _calc_plant_state(self, context, output) -> None:
        s = self._state(context)
        x, payload = from_rotorpy(s, self._real.center), self._real.payload(s)
        pose, velocity = [x[3:7], x[0:3]], [attitude.rotate(x[3:7], x[10:13]), x[7:10]]
        if payload.size:  # a point has no attitude
            pose += [np.array([1.0, 0.0, 0.0, 0.0]), payload[:3]]
            velocity += [np.zeros(3), payload[3:]]
        output.SetFromVector(np.concatenate(pose + velocity))


def make_rotorpy_vehicle(
    vehicle: Vehicle,
    effects: Sequence[Effect | MeasurementEffect],
    *,
    command_period: float = 0.001,
    own: bool = False,
) -> Diagram:
    """Return the subsystem `rotorpy`, a `RotorPyVehicle`, with its commands delayed as the effects
    say.

    Args:
        command_period: at multiples of which `u` changes [s].
        own: as of `RotorPyVehicle`.
    """
    builder = DiagramBuilder()
    rotorpy = builder.AddNamedSystem("rotorpy", RotorPyVehicle(vehicle, effects, own=own))
    if rotorpy.dead_time >= SOONEST:
        buffer = CommandBuffer(
            rotorpy.hover_input, dead_time=rotorpy.dead_time, period=command_period
        )
        builder.AddNamedSystem("command_buffer", buffer)
        builder.Connect(buffer.get_output_port(), rotorpy.get_input_port())
        builder.ExportInput(buffer.get_input_port(), "u")
    else:
        builder.ExportInput(rotorpy.get_input_port(), "u")
    for name in OUTPUTS:
        builder.ExportOutput(rotorpy.GetOutputPort(name), name)
    return builder.Build()


@dc.dataclass(frozen=True)
class ForeignVehicle(RealVehicle):
    """The `RealVehicle` that rotorpy flies, with the effects of the reality.

    The sensors are those of the loop, and Drake integrates. A gusty wind has the same statistics as
    in Drake, but other
    gusts.
    own: whether rotorpy's own drag, lift and motor lag act beside the effects (`own_physics`).
    """

    own: bool = False

    def make(
        self,
        vehicle: Vehicle,
        reality: RealityConfig,
        *,
        command_period: float = 0.001,
        pushed: bool = False,
        events: Sequence[PayloadEvent] = (),
    ) -> Diagram:
        """Return the vehicle.

        Args:
            command_period: at multiples of which the command changes [s].
        Raises: ValueError: on what rotorpy does not know (`foreign_effects`), events or pushes.
        """
        if events:
            raise ValueError(
                "rotorpy: events must be none for this simulator; fly Drake's vehicle."
            )
        if pushed:
            raise ValueError(
                "rotorpy: there must be no pushes from outside; watch a flight of Drake's vehicle."
            )
        effects = foreign_effects(reality)
        return make_rotorpy_vehicle(vehicle, effects, command_period=command_period, own=self.own)

    def hover(
        self, system: Diagram, root: Context, reality: RealityConfig, p_WB: np.ndarray
    ) -> None:
        """Set the vehicle level and at rest, with the payload hanging still.

        Args:
            system: as `make` returns it.
            reality: as of `make`.
            p_WB: (3,) place of Bo [m].
        """
        rotorpy = system.GetSubsystemByName("rotorpy")
        assert isinstance(rotorpy, RotorPyVehicle)
        rotorpy.set_hover(rotorpy.GetMyMutableContextFromRoot(root), p_WB)


def foreign_effects(reality: RealityConfig) -> list[Effect | MeasurementEffect]:
    """Return the effects of a reality that rotorpy flies, without those of sensors.

    Raises: ValueError: on an effect that begins in flight, a disturbance, a rod, or lags in series.
    """
    if reality.disturbance.acts:
        raise ValueError(
            "rotorpy: disturbance must be none; it is what a model leaves over, and no effect."
        )
    if reality.onsets:
        late = ", ".join(effect.identifier for effect in reality.onsets)
        raise ValueError(f"rotorpy: effects must act from the start; {late} begins in flight.")
    if reality.hung.tether == "rod":
        raise ValueError("rotorpy: tether must be cable or none; got rod.")
    if len(reality.lags) > 1:
        raise ValueError(
            f"rotorpy: there must be one motor lag at most; got {len(reality.lags)} in series."
        )
    hung = reality.hung.tether != "none"  # a payload without mass is none
    return [
        effect
        for effect in reality.everything()
        if not hasattr(effect, "measure") and (hung or effect.identifier != "suspended_payload")
    ]
