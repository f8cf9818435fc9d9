"""The vehicle under its controller in Drake, advanced from row to row of a log."""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import Adder

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.simulators.flight_plan import require_flying
from np_drake import attitude
from np_drake.effects.base import Effect
from np_drake.effects.combine import EffectsByPlace, split_effects
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle
from systems.cascaded_controller import CascadedController
from systems.payload_config import PayloadConfig, payload_config
from systems.tethered_quadrotor import make_tethered_quadrotor

CABLE_RATE, CABLE_DAMPING = 250.0, 0.3  # of the cable: frequency [rad/s] and damping ratio [1]
# Steps of the integrator [s]: one between rows 10 ms apart, jitter included, three with a cable;
# share of a lag.
STEP, CABLE_STEP, LAG_SHARE = 0.0112, 0.0037, 0.2


def _largest_step(vehicle: Vehicle, places: EffectsByPlace) -> float:
    """Return a step at which runge_kutta3 is stable and follows the lags to a few parts in a
    thousand [s].
    """
    lags = [vehicle.rotor_time_constant] if vehicle.rotor_time_constant > 0 else []
    for effect in places.actuator:
        lags += [
            getattr(effect, name) for name in ("time_constant", "time") if hasattr(effect, name)
        ]
    return min([STEP if places.payload is None else CABLE_STEP, *(LAG_SHARE * lag for lag in lags)])


def stiff_cable(effect: SuspendedPayload | None, vehicle: Vehicle) -> PayloadConfig:
    """Return the payload on a cable as stiff as the integrator's step allows.

    Args:
        effect: the payload; None: there is none.
    """
    payload = payload_config(effect)
    if payload.tether == "none":
        return payload
    reduced = payload.mass * vehicle.mass / (payload.mass + vehicle.mass)
    stiffness, damping = reduced * CABLE_RATE**2, 2 * CABLE_DAMPING * reduced * CABLE_RATE
    return dc.replace(payload, stiffness=stiffness, damping=damping)


class DrakeLoop:
    """Plant and controller with one set of effects; a flight with an onset takes two, one after the
    other.

    The command goes through this loop, which keeps it back by the effects' dead time: exact for
    rows at any instants.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[Effect]):
        """Build the diagram."""
        places = split_effects(effects)
        self._vehicle, self._payload = vehicle, stiff_cable(places.payload, vehicle)
        self._dead_time = sum(effect.dead_time for effect in places.actuator)
        self._on_the_way: list[tuple[float, np.ndarray]] = []  # commands, and when they arrive [s]
        builder = DiagramBuilder()
        self._real = make_tethered_quadrotor(
            vehicle,
            self._payload,
            wrench_effects=places.wrench,
            # As they act: first what changes how rotors turn, then what turning rotors give.
            actuator_effects=sorted(
                (e for e in places.actuator if e.dead_time == 0.0),
                key=lambda effect: not effect.turns_rotor,
            ),
            mass_effects=places.mass,
        )
        builder.AddSystem(self._real)
        self._controller = builder.AddNamedSystem(
            "controller", CascadedController(vehicle, period=None)
        )
        seen = builder.AddNamedSystem("seen", Adder(2, 13))
        builder.Connect(self._real.GetOutputPort("x"), seen.get_input_port(0))
        builder.ExportInput(seen.get_input_port(1), "noise")
        builder.Connect(seen.get_output_port(), self._controller.GetInputPort("x"))
        builder.ExportInput(self._real.GetInputPort("u"), "u")
        self._plant = self._real.GetSubsystemByName("plant")
        self._simulator = Simulator(builder.Build())
        config = SimulatorConfig(
            integration_scheme="runge_kutta3",
            max_step_size=_largest_step(vehicle, places),
            use_error_control=False,
        )
        ApplySimulatorConfig(config, self._simulator)
        self._root = self._simulator.get_mutable_context()
        self._command(vehicle.hover_input)
        self._noise_port = self._simulator.get_system().GetInputPort("noise")
        self._noise_port.FixValue(self._root, np.zeros(13))

    def start(self, t: float, x: np.ndarray, before: "DrakeLoop | None" = None) -> None:
        """Put the vehicle into a state; a payload hangs still under the moving hook.

        Args:
            t: time [s].
            x: (13,) state.
            before: loop whose controller, commands under way and rotors carry on in this one.
        """
        self._root.SetTime(t)
        q, v, w_W = x[3:7], x[7:10], attitude.rotate(x[3:7], x[10:13])
        R_WB = RotationMatrix(Quaternion(q / np.linalg.norm(q)))
        self._place("quadrotor", RigidTransform(R_WB, x[0:3]), SpatialVelocity(w_W, v))
        if self._payload.tether == "cable":
            hook_W = attitude.rotate(q, np.array(self._payload.hook))
            stretch = self._payload.mass * self._vehicle.gravity / self._payload.stiffness
            p_WP = x[0:3] + hook_W - [0.0, 0.0, self._payload.length + stretch]
            v_WP = v + np.cross(w_W, hook_W)
            self._place("payload", RigidTransform(p_WP), SpatialVelocity(np.zeros(3), v_WP))
        if before is not None:
            held = before._context(before._controller).get_discrete_state(0).CopyToVector()
            self._context(self._controller).SetDiscreteState(0, held)
            self._command(before._acting)
            self._on_the_way = list(before._on_the_way)
            self._keep_rotors(before._eval(before._real, "nominal_rotor_thrust"))

    def _place(self, body: str, X_WB: RigidTransform, V_WB: SpatialVelocity) -> None:
        context, body = self._context(self._plant), self._plant.GetBodyByName(body)
        self._plant.SetFreeBodyPose(context, body, X_WB)
        self._plant.SetFreeBodySpatialVelocity(context=context, body=body, V_JpJc=V_WB)

    def _keep_rotors(self, thrust: np.ndarray) -> None:
        """Let rotors turn on as fast as they do at `thrust` (4,) [N]."""
        if self._real.HasSubsystemNamed("actuators"):
            actuators = self._real.GetSubsystemByName("actuators")
            actuators.rest_at(self._context(actuators), thrust)

    def fly(
        self, t: np.ndarray, targets: np.ndarray, end: float, noise: np.ndarray | None = None
    ) -> dict[str, np.ndarray]:
        """Fly the rows, then on to the end.

        Args:
            t: (n,) instants of the rows [s].
            targets: (n, 16) of the cascaded controller.
            end: [s].
            noise: (n, 13) error of the state that the controller sees; None: none.
        Returns: x (n, 13), a in W, al in B (n, 3), nominal_thrust, u (n, 4), each right after the
            row's command.
        Raises: FailedRun: if the vehicle is lost or the integrator gives up.
        """
        rows: list[np.ndarray] = []
        target_port, context = (
            self._controller.GetInputPort("target"),
            self._context(self._controller),
        )
        for i, target in enumerate(targets):
            target_port.FixValue(context, target)
            if noise is not None:
                self._noise_port.FixValue(self._root, noise[i])
            self._controller.update(context)
            u = self._controller.GetOutputPort("u").Eval(context).copy()
            self._on_the_way.append((self._root.get_time() + self._dead_time, u))
            self._deliver()
            rows.append(np.concatenate([u, self._reading()]))
            if not i % 10:
                require_flying(self.state(), target, self._root.get_time())
            self._advance(t[i + 1] if i + 1 < len(t) else end)
        return _unpack(np.array(rows), self._plant.num_positions())

    def state(self) -> np.ndarray:
        """Return the state (13,) now."""
        return self._eval(self._real, "x").copy()

    def _context(self, system) -> Context:
        return system.GetMyMutableContextFromRoot(self._root)

    def _eval(self, system, port: str) -> np.ndarray:
        return system.GetOutputPort(port).Eval(self._context(system))

    @cached_property
    def _ports(self) -> list:
        """Return (port, context) of what a row holds beside the command."""
        instance = self._plant.GetBodyByName("quadrotor").model_instance()
        return [
            (self._real.GetOutputPort("nominal_rotor_thrust"), self._context(self._real)),
            (self._plant.get_state_output_port(), self._context(self._plant)),
            (
                self._plant.get_generalized_acceleration_output_port(instance),
                self._context(self._plant),
            ),
        ]

    def _reading(self) -> np.ndarray:
        return np.concatenate([port.Eval(context) for port, context in self._ports])

    def _command(self, u: np.ndarray) -> None:
        self._acting = u
        self._simulator.get_system().GetInputPort("u").FixValue(self._root, u)

    def _deliver(self) -> None:
        """Hand on the commands that have arrived by now."""
        while self._on_the_way and self._on_the_way[0][0] <= self._root.get_time() + 1e-9:
            self._command(self._on_the_way.pop(0)[1])

    def _advance(self, t: float) -> None:
        try:
            while self._on_the_way and self._on_the_way[0][0] < t - 1e-9:
                self._simulator.AdvanceTo(self._on_the_way[0][0])
                self._deliver()
            self._simulator.AdvanceTo(t)
        except RuntimeError as error:
            raise FailedRun(f"challenge: the simulation ended before {t:.2f} s: {error}") from error


def _unpack(rows: np.ndarray, num_positions: int) -> dict[str, np.ndarray]:
    """Return rows [u, nominal thrust, plant state, its rates] as signals by name, see
    `DrakeLoop.fly`.
    """
    u, nominal, s = rows[:, :4], rows[:, 4:8], rows[:, 8:]
    velocities, size = s[:, num_positions:], 6 * (num_positions // 7)
    w_W, v, rates = velocities[:, 0:3], velocities[:, 3:6], velocities[:, size:]
    q = s[:, 0:4] / np.linalg.norm(s[:, 0:4], axis=1, keepdims=True)
    x = np.concatenate([s[:, 4:7], q, v, attitude.rotate_back(q, w_W)], axis=1)
    return {
        "x": x,
        "a": rates[:, 3:6],
        "al": attitude.rotate_back(q, rates[:, 0:3]),
        "nominal_thrust": nominal,
        "u": u,
    }
