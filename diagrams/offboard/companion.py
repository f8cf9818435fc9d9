"""Estimator, predictor and MPC as they run beside a vehicle: the systems of a flight's Diagram,
without its vehicle.
"""

import dataclasses as dc

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import PassThrough

from diagrams.loop.controllers import add_controller
from diagrams.loop.flight import FlightConfig
from np_drake.mpc.problem import MpcStatus

INPUTS = {"x": 13, "acceleration": 6, "in_force": 4}  # of the Diagram, and their sizes


@dc.dataclass(frozen=True)
class Answer:
    """What the controller says of one instant."""

    rates_thrust: np.ndarray  # (4,) collective thrust and body rates [N, rad/s]
    force: (
        np.ndarray
    )  # (3,) residual force that is predicted; zero of a model that predicts none [N]
    status: MpcStatus
    solve_time: float  # [s]
    generation: int = 0  # of the memory that it is of [1]


def make_companion_diagram(config: FlightConfig) -> Diagram:
    """Return the controller of a flight, with input ports for what is measured.

    | port | size | meaning | unit |
    |---|---|---|---|
    | x | 13 | measured state | |
    | acceleration | 6 | measured [a in W, al in B] | m/s², rad/s² |
    | in_force | 4 | collective thrust and body rates that the autopilot follows | N, rad/s |
    | rates_thrust | 4 | what it is to follow | N, rad/s |
    Raises: ValueError: where it does not.
    """
    if config.controller.mpc.command != "rates":
        raise ValueError(
            f"{config.name}: controller.mpc.command must be rates beside an autopilot; got rotors."
        )
    builder, sensors = DiagramBuilder(), DiagramBuilder()
    for name in ("x", "acceleration"):
        wire = sensors.AddNamedSystem(name, PassThrough(INPUTS[name]))
        sensors.ExportInput(wire.get_input_port(), name)
        sensors.ExportOutput(wire.get_output_port(), name)
    rig = builder.AddNamedSystem("sensors", sensors.Build())
    in_force = builder.AddNamedSystem("in_force", PassThrough(INPUTS["in_force"]))
    ports = add_controller(
        builder,
        config.controller,
        config.vehicle,
        config.motion,
        rig,
        in_force=in_force.get_output_port(),
    )
    for name in ("x", "acceleration"):
        builder.ExportInput(rig.GetInputPort(name), name)
    builder.ExportInput(in_force.get_input_port(), "in_force")
    for name, port in ports.items():
        builder.ExportOutput(port, name)
    diagram = builder.Build()
    diagram.set_name("companion")
    return diagram


class Companion:
    """Controller that is stepped by the clock of its caller, without a Simulator."""

    def __init__(self, config: FlightConfig):
        self._diagram = make_companion_diagram(config)
        self.reset()

    def reset(self) -> None:
        """Forget all that was measured; a step that goes on meanwhile does not count."""
        self.context = self._diagram.CreateDefaultContext()

    def step(
        self,
        t: float,
        *,
        x: np.ndarray,
        acceleration: np.ndarray,
        in_force: np.ndarray,
        context: Context | None = None,
    ) -> Answer:
        """Take the measurements of an instant and return what to do.

        Args:
            t: time on the reference [s].
            x: (13,) in the axes of the reference; NaN where nothing is measured.
            acceleration: (6,) [a in these axes, al in B] [m/s², rad/s²].
            in_force: (4,) collective thrust and body rates since the last instant [N, rad/s].
            context: as `context` was when the step was asked for; None: as it is.
        """
        diagram, context = self._diagram, context or self.context
        context.SetTime(t)
        for name, value in (("x", x), ("acceleration", acceleration), ("in_force", in_force)):
            diagram.GetInputPort(name).FixValue(context, value)
        context.SetDiscreteState(diagram.EvalUniquePeriodicDiscreteUpdate(context))

        def read(name: str) -> np.ndarray:
            return diagram.GetOutputPort(name).Eval(context)

        return Answer(
            rates_thrust=read("rates_thrust"),
            force=read("chi_hat")[:3] if diagram.HasOutputPort("chi_hat") else np.zeros(3),
            status=MpcStatus(int(read("status")[0])),
            solve_time=float(read("solve_time")[0]),
        )
