"""Cooperative transport: three quadrotors carry one payload, each with its own controller and no
view of the others.

An example of a Diagram with several vehicles: `python -m diagrams.payload.cooperative` flies it and
prints the errors.
"""

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort

from diagrams.loop.controller_config import ControllerConfig
from diagrams.loop.controllers import add_controller
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.metrics import tracking_errors
from np_drake.references.base import Hover, Reference, Sum
from np_drake.references.payload import closest_approach, polygon
from np_drake.references.waypoints import Stops
from np_drake.vehicle import Vehicle
from systems.cooperative_quadrotors import make_cooperative_quadrotors
from systems.initial_state import set_formation
from systems.payload_config import PayloadConfig
from systems.recorder import Recorder, add_recorder
from systems.sensor_model import make_sensor_model

VEHICLE, PAYLOAD = Vehicle(), PayloadConfig(mass=0.5, length=1.2)
CORNERS = polygon(3, 0.9)  # of the formation about its centre [m]
PERIOD = 0.02  # of controllers and recorder [s]
START, TRANSPORT, END = 5.0, 9.0, 15.0  # the transport begins, lasts; the flight ends [s]


def center_of_formation() -> Reference:
    """Return the motion of the formation's centre: 2 m along x, from rest to rest, at a height of 2
    m.
    """
    ends = np.array([[-1.0, 0.0, 2.0], [1.0, 0.0, 2.0]])
    return Stops(ends, np.array([START]), np.array([TRANSPORT]))


def make_pilot(config: ControllerConfig, reference: Reference, number: int) -> Diagram:
    """Return sensors, reference, estimator, predictor and MPC of one vehicle."""
    builder = DiagramBuilder()
    rig = builder.AddSystem(make_sensor_model(VEHICLE, [SensorNoise()], period=PERIOD))
    ports = add_controller(builder, config, VEHICLE, reference, rig)
    for name, port in (("x", "x_true"), ("acceleration", "acceleration_true")):
        builder.ExportInput(rig.GetInputPort(port), name)
    builder.ExportInput(rig.GetInputPort("nominal_rotor_thrust"), "nominal_rotor_thrust")
    for name in ("u", "p_ref"):
        builder.ExportOutput(ports[name], name)
    pilot = builder.Build()
    pilot.set_name(f"pilot_{number}")
    return pilot


def make_cooperative_diagram(kind: str = "payload_filter") -> tuple[Diagram, Recorder]:
    """Return the Diagram of all vehicles and their payload, and its recorder; `kind` is that of the
    controllers.
    """
    builder = DiagramBuilder()
    fleet = builder.AddSystem(make_cooperative_quadrotors(VEHICLE, PAYLOAD, count=len(CORNERS)))
    config, center = ControllerConfig(kind=kind, period=PERIOD), center_of_formation()
    signals: dict[str, OutputPort] = {}
    for i, corner in enumerate(CORNERS):
        pilot = builder.AddSystem(make_pilot(config, Sum(center, Hover(corner)), i))
        for name in ("x", "acceleration", "nominal_rotor_thrust"):
            builder.Connect(fleet.GetOutputPort(f"{name}_{i}"), pilot.GetInputPort(name))
        builder.Connect(pilot.GetOutputPort("u"), fleet.GetInputPort(f"u_{i}"))
        signals |= {
            f"x_{i}": fleet.GetOutputPort(f"x_{i}"),
            f"p_ref_{i}": pilot.GetOutputPort("p_ref"),
        }
    recorder = add_recorder(builder, signals, period=PERIOD)
    return builder.Build(), recorder


def set_initial_state(diagram: Diagram, context: Context, *, seed: int = 0) -> None:
    """Set the noise seed, the vehicles level at their corners, and the payload hanging between
    them.

    Args:
        diagram: of `make_cooperative_diagram`.
    """
    diagram.SetRandomContext(context, RandomGenerator(seed))
    plant = diagram.GetSubsystemByName("cooperative_quadrotors").GetSubsystemByName("plant")
    start = center_of_formation().sample(np.zeros(1))[0, 0] + CORNERS
    set_formation(plant, plant.GetMyMutableContextFromRoot(context), PAYLOAD, start)


def fly(kind: str = "payload_filter", *, end: float = END, seed: int = 0) -> dict[str, np.ndarray]:
    """Simulate the transport with a plain `Simulator` and return the recorded signals (see
    `Recorder.read`).

    Args:
        end: of the flight [s].
    """
    diagram, recorder = make_cooperative_diagram(kind)
    simulator = Simulator(diagram)
    ApplySimulatorConfig(SimulatorConfig(max_step_size=0.004, use_error_control=False), simulator)
    set_initial_state(diagram, simulator.get_mutable_context(), seed=seed)
    simulator.AdvanceTo(end)
    return recorder.read(diagram, simulator.get_context())


def main() -> None:
    """Print the position errors of every vehicle after 3 s, with and without a model of the payload
    [m].
    """
    for kind in ("nominal", "payload_filter"):
        rows = fly(kind)
        p = np.stack([rows[f"x_{i}"][:, :3] for i in range(len(CORNERS))])
        errors = [
            tracking_errors(p[i, 150:], rows[f"p_ref_{i}"][150:]) for i in range(len(CORNERS))
        ]
        print(kind, errors, f"closest approach {closest_approach(p):.2f} m")


if __name__ == "__main__":
    main()
