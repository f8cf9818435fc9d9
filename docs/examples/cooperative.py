"""Three quadrotors carry one payload, each with its own controller and no view of the others."""

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from systems.cooperative_quadrotors import make_cooperative_quadrotors

from diagrams import ControllerConfig, add_controller
from np_drake import Vehicle, tracking_errors
from np_drake.effects.sensor_noise import SensorNoise
from np_drake.references.payload import closest_approach, fly_at, polygon
from np_drake.references.waypoints import Stops
from systems.payload_config import PayloadConfig
from systems.plant import set_formation
from systems.recorder import add_recorder
from systems.sensor_model import make_sensor_model

VEHICLE, PAYLOAD = Vehicle(), PayloadConfig(mass=0.5, length=1.2)
CORNERS = polygon(3, 0.9)  # of the formation about its centre [m]
PERIOD, SETTLED = 0.02, 50  # of the controllers [s]; rows until the formation hovers
ENDS = np.array([[-1.0, 0.0, 2.0], [1.0, 0.0, 2.0]])  # of the centre, from rest to rest [m]
CENTER = Stops(ENDS, np.array([1.0]), np.array([4.0]))  # when it starts, how long it takes [s]


def make_pilot(kind, corner):
    """Return sensors, reference, estimator, predictor and MPC of one vehicle."""
    builder = DiagramBuilder()
    rig = builder.AddSystem(make_sensor_model(VEHICLE, [SensorNoise()], period=PERIOD))
    config = ControllerConfig(kind=kind, period=PERIOD)
    ports = add_controller(builder, config, VEHICLE, fly_at(CENTER, corner), rig)
    for name, port in (("x", "x_true"), ("acceleration", "acceleration_true")):
        builder.ExportInput(rig.GetInputPort(port), name)
    builder.ExportInput(rig.GetInputPort("nominal_rotor_thrust"), "nominal_rotor_thrust")
    for name in ("u", "p_ref"):
        builder.ExportOutput(ports[name], name)
    return builder.Build()


for kind in ("nominal", "payload_filter"):  # without and with a model of the payload
    builder, signals = DiagramBuilder(), {}
    fleet = builder.AddSystem(make_cooperative_quadrotors(VEHICLE, PAYLOAD, count=len(CORNERS)))
    for i, corner in enumerate(CORNERS):
        pilot = builder.AddSystem(make_pilot(kind, corner))
        for name in ("x", "acceleration", "nominal_rotor_thrust"):
            builder.Connect(fleet.GetOutputPort(f"{name}_{i}"), pilot.GetInputPort(name))
        builder.Connect(pilot.GetOutputPort("u"), fleet.GetInputPort(f"u_{i}"))
        signals[f"x_{i}"] = fleet.GetOutputPort(f"x_{i}")
        signals[f"p_ref_{i}"] = pilot.GetOutputPort("p_ref")
    recorder, diagram = add_recorder(builder, signals, period=PERIOD), builder.Build()
    simulator = Simulator(diagram)
    ApplySimulatorConfig(SimulatorConfig(max_step_size=0.004, use_error_control=False), simulator)
    context, plant = simulator.get_mutable_context(), fleet.GetSubsystemByName("plant")
    start = CENTER.sample(np.zeros(1))[0, 0] + CORNERS
    set_formation(plant, plant.GetMyMutableContextFromRoot(context), PAYLOAD, start)
    simulator.AdvanceTo(4.0)
    rows = recorder.read(diagram, context)
    p = np.stack([rows[f"x_{i}"][:, :3] for i in range(len(CORNERS))])
    error = tracking_errors(p[0, SETTLED:], rows["p_ref_0"][SETTLED:])["position_rmse"]
    print(f"{kind}: {100 * error:.1f} cm; closest approach {closest_approach(p):.2f} m")
