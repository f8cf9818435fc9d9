"""Wires a Drake diagram of its own: vehicle, sensors, controller, recorder.

Shows: `make_tethered_quadrotor` with effects that the controller does not know, `add_sensor_model`,
`add_controller`, and how the recorded signals are read after the simulation.
"""

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import Diagram, DiagramBuilder

from diagrams import ControllerConfig, add_controller
from np_drake import Vehicle, effects, lemniscate, tracking_errors
from systems import (
    PayloadConfig,
    add_recorder,
    add_sensor_model,
    make_tethered_quadrotor,
    set_hover,
)
from systems.recorder import Recorder

VEHICLE = Vehicle()
PAYLOAD = PayloadConfig(mass=0.3, length=0.7)
TRACK = lemniscate(length=1.5, width=0.75, height=1.5, speed=1.0, ramp=3.0)
PERIOD = 0.02  # of controller and recorder [s]


def make_diagram(kind: str) -> tuple[Diagram, Recorder]:
    """The closed loop of the controller `kind` on a vehicle with drag, in a wind of 1 m/s along
    x.
    """
    builder = DiagramBuilder()
    acting = [effects.LinearDrag(0.3, 0.3, 0.2), effects.ConstantWind(1.0, 0.0, 0.0)]
    quadrotor = builder.AddSystem(make_tethered_quadrotor(VEHICLE, PAYLOAD, wrench_effects=acting))
    sensors = add_sensor_model(builder, quadrotor, VEHICLE, [effects.SensorNoise()], period=PERIOD)
    config = ControllerConfig(kind=kind, period=PERIOD)
    ports = add_controller(builder, config, VEHICLE, TRACK, sensors)
    builder.Connect(ports["u"], quadrotor.GetInputPort("u"))
    signals = {"x": quadrotor.GetOutputPort("x"), "p_ref": ports["p_ref"]}
    recorder = add_recorder(builder, signals, period=PERIOD)
    return builder.Build(), recorder


def main() -> None:
    """Flies 8 s with nominal MPC and payload_filter; prints the errors after the ramp [m]."""
    for kind in ("nominal", "payload_filter"):
        diagram, recorder = make_diagram(kind)
        simulator = Simulator(diagram)
        ApplySimulatorConfig(
            SimulatorConfig(max_step_size=0.004, use_error_control=False), simulator
        )
        plant = diagram.GetSubsystemByName("tethered_quadrotor").GetSubsystemByName("plant")
        context = simulator.get_mutable_context()
        set_hover(
            plant,
            plant.GetMyMutableContextFromRoot(context),
            PAYLOAD,
            TRACK.sample(np.zeros(1))[0, 0],
        )
        simulator.AdvanceTo(8.0)
        rows = recorder.read(diagram, context)
        print(kind, tracking_errors(rows["x"][150:, :3], rows["p_ref"][150:]))


if __name__ == "__main__":
    main()
