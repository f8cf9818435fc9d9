"""Simulated vehicles whose command is a policy's action."""

import dataclasses as dc
from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import Adder, ConstantVectorSource, MatrixGain

from diagrams.loop.flight import ARENA, FlightConfig
from diagrams.loop.flight_diagram import set_initial_state
from diagrams.loop.flight_result import GROUND
from diagrams.loop.real_vehicle import make_real_vehicle
from np_drake.control.tracking_task import ACTION_SIZE, TrackingTask, command_span
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.references.base import Reference
from systems.cascade_target import CascadeTarget
from systems.cascaded_controller import CascadedController
from systems.sensor_model import add_sensor_model
from systems.tracking_observation import TrackingObservation

Draw = Callable[[np.random.Generator], FlightConfig]
BASES = ("hover", "cascade")  # commands that an action is added to


@dc.dataclass(frozen=True)
class ActionConfig:
    """Meaning of an action."""

    base: str = "hover"  # hover | cascade: command that the action is added to
    authority: float = 1.0  # share of `command_span` that an action of one adds [1]

    def check(self) -> "ActionConfig":
        """Return self after checking both values.

        Raises: ValueError: where one is impossible.
        """
        if self.base not in BASES:
            raise ValueError(f"ActionConfig: base must be one of {', '.join(BASES)}; got {self.base!r}.")
        if not 0 < self.authority < np.inf:
            raise ValueError(f"ActionConfig: authority must be positive and finite; got {self.authority}.")
        return self


def _make_tracking_diagram(config: FlightConfig, task: TrackingTask, action: ActionConfig) -> Diagram:
    """Return real vehicle, sensors, base command and observation as one Diagram.

    | port | size | meaning | unit |
    |---|---|---|---|
    | action (in) | 4 | thrust and torques over `command_span` | 1 |
    | observation | 18 + 3 n | see `np_drake.control.tracking_task.observe` | |
    """
    config.check()
    builder = DiagramBuilder()
    reference, tick = config.motion, cascade_period(config)
    vehicle = builder.AddSystem(make_real_vehicle(config.vehicle, config.reality, command_period=tick))
    noise = [SensorNoise(config.reality.noise)]
    rig = add_sensor_model(builder, vehicle, config.vehicle, noise, period=config.controller.period)
    x = rig.GetOutputPort("x")
    span = action.authority * command_span(config.vehicle)
    scale = builder.AddNamedSystem("action", MatrixGain(np.diag(span)))
    total = builder.AddNamedSystem("command", Adder(2, len(span)))
    builder.Connect(_add_base(builder, config, reference, action.base, x), total.get_input_port(0))
    builder.Connect(scale.get_output_port(), total.get_input_port(1))
    builder.Connect(total.get_output_port(), vehicle.GetInputPort("u"))
    observation = builder.AddNamedSystem("observation", TrackingObservation(reference, task))
    builder.Connect(x, observation.get_input_port())
    builder.ExportInput(scale.get_input_port(), "action")
    builder.ExportOutput(observation.get_output_port(), "observation")
    diagram = builder.Build()
    diagram.set_name(config.name)
    return diagram


def _add_base(
    builder: DiagramBuilder, config: FlightConfig, reference: Reference, base: str, x: OutputPort
) -> OutputPort:
    """Add the command that the action is added to and return its port."""
    if base == "hover":
        hover = ConstantVectorSource(config.vehicle.hover_input)
        return builder.AddNamedSystem("hover", hover).get_output_port()
    period = cascade_period(config)
    target = CascadeTarget(config.vehicle, reference, period=period, end=config.end)
    builder.AddNamedSystem("target", target)
    cascade = builder.AddNamedSystem("cascade", CascadedController(config.vehicle, period=period))
    builder.Connect(x, cascade.GetInputPort("x"))
    builder.Connect(target.get_output_port(), cascade.GetInputPort("target"))
    return cascade.get_output_port()


def cascade_period(config: FlightConfig) -> float:
    """Return the time between two updates of the cascaded controller: 10 ms for the paper's vehicle [s]."""
    return 0.5 * config.controller.period


class TrackingSimulator:
    """Simulator of an experiment, its reference and its task.

    Args:
        config: the experiment.
        task: observation and reward.
        action: what an action means.
        period: between two decisions; default: the controller's [s].
    Raises: ValueError: if the period is no whole multiple of the controller's, at which the sensors are read.
    """

    def __init__(self, config: FlightConfig, task: TrackingTask, action: ActionConfig, period: float | None = None):
        self.config, self.task, self.reference = config, task, config.motion
        self.period = config.controller.period if period is None else period
        ratio = self.period / config.controller.period
        if not (np.isfinite(ratio) and ratio > 0.5 and abs(ratio - round(ratio)) < 1e-9):
            raise ValueError(
                f"TrackingSimulator: period must be a whole multiple of {config.controller.period:g} s, at which the "
                f"sensors are read; got {period}."
            )
        self.simulator = Simulator(_make_tracking_diagram(config, task, action))
        self._vehicle = self.simulator.get_system().GetSubsystemByName("tethered_quadrotor")

    @property
    def decisions(self) -> int:
        """Number of decisions from the start to the experiment's end."""
        return max(1, round(self.config.end / self.period))

    def start(self, context: Context, seed: int) -> None:
        """Set the vehicle hovering at the start of its reference.

        Args:
            context: of the whole diagram.
            seed: of the sensors' noise.
        """
        diagram = self.simulator.get_system()
        set_initial_state(diagram, context, self.config, seed=seed)
        diagram.GetInputPort("action").FixValue(context, np.zeros(ACTION_SIZE))
        ApplySimulatorConfig(self.config.simulator, self.simulator)  # an integrator remembers its last step
        self.simulator.Initialize()

    def position(self, context: Context) -> np.ndarray:
        """Return the true position (3,) [m]."""
        return self._vehicle.GetOutputPort("x").Eval(self._vehicle.GetMyContextFromRoot(context))[:3]

    def error(self, context: Context) -> np.ndarray:
        """Return reference minus true position (3,) [m]."""
        return self.reference.sample(np.array([context.get_time()]))[0, 0] - self.position(context)

    def reward(self, context: Context) -> float:
        """Return the task's reward times the period [s]."""
        action = self.simulator.get_system().GetInputPort("action").Eval(context)
        return self.period * self.task.reward(self.error(context), action)

    def loss(self, context: Context) -> str:
        """Return why the vehicle counts as lost; empty where it flies."""
        p_WB = self.position(context)
        if not np.linalg.norm(p_WB) < ARENA:
            return f"it left the arena of {ARENA:g} m"
        if p_WB[2] < GROUND:
            return "it flew into the ground"
        if not np.linalg.norm(self.error(context)) < self.task.tolerance:
            return f"it was more than {self.task.tolerance:.3g} m off its reference"
        return ""


class SimulatorPool:
    """At most `size` simulators, each built when it is first asked for and kept.

    Drake never frees a diagram with callbacks in Python, 1.5 to 2.5 MB each. A pool bounds their number whatever the
    number of episodes. The configurations are drawn at once, so that an impossible one is refused before any episode.

    Args:
        draw: a configuration from a random generator.
        make: simulator of a configuration.
        size: largest number of simulators.
        seed: of the draws, each of which has a generator of its own.
    Raises: ValueError: on a size below one or an impossible configuration.
    """

    def __init__(self, draw: Draw, make: Callable[[FlightConfig], TrackingSimulator], *, size: int, seed: int = 0):
        if size < 1:
            raise ValueError(f"SimulatorPool: simulators must be at least 1; got {size}.")
        self.configs = [draw(np.random.default_rng([seed, i])).check() for i in range(size)]
        self._make = make
        self._built: dict[int, TrackingSimulator] = {}

    def __len__(self) -> int:
        return len(self.configs)

    def __getitem__(self, index: int) -> TrackingSimulator:
        if index not in self._built:
            self._built[index] = self._make(self.configs[index])
        return self._built[index]
