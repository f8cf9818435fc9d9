"""Flies a controller of one's own, a LeafSystem, in the place of the project's.

Shows: which ports a controller needs, and how it is connected to the sensors and the vehicle.
"""

from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from np_drake import Vehicle
from systems import PayloadConfig, add_sensor_model, make_tethered_quadrotor, set_hover

VEHICLE, PAYLOAD = Vehicle(), PayloadConfig(tether="none")
HEIGHT = 1.5  # [m]


class Hover(LeafSystem):
    """Thrust against height and climb, torque against tilt and body rate.

    Input x (13,) [p_WB, q_WB, v_WB, w_WB_B]; output u (4,) [f_u, tau_m] [N, N·m].
    """

    def __init__(self):
        super().__init__()
        self._x = self.DeclareVectorInputPort("x", 13)
        self.DeclareVectorOutputPort("u", 4, self._calc_u)

    def _calc_u(self, context, output):
        x = self._x.Eval(context)
        thrust = VEHICLE.mass * (VEHICLE.gravity + 4 * (HEIGHT - x[2]) - 4 * x[9])
        torque = -VEHICLE.J @ (100 * x[4:7] + 14 * x[10:13])
        output.SetFromVector([thrust, *torque])


def main() -> None:
    """Rises from 1 m to the height in 4 s, and prints the height that is reached [m]."""
    builder = DiagramBuilder()
    quadrotor = builder.AddSystem(make_tethered_quadrotor(VEHICLE, PAYLOAD))
    sensors = add_sensor_model(builder, quadrotor, VEHICLE, [], period=0.01)
    controller = builder.AddSystem(Hover())
    builder.Connect(sensors.GetOutputPort("x"), controller.GetInputPort("x"))
    builder.Connect(controller.GetOutputPort("u"), quadrotor.GetInputPort("u"))
    simulator = Simulator(builder.Build())
    plant, root = quadrotor.GetSubsystemByName("plant"), simulator.get_mutable_context()
    set_hover(plant, plant.GetMyMutableContextFromRoot(root), PAYLOAD, [0.0, 0.0, 1.0])
    simulator.AdvanceTo(4.0)
    height = sensors.GetOutputPort("x").Eval(sensors.GetMyContextFromRoot(root))[2]
    print(f"{height:.3f}")


if __name__ == "__main__":
    main()
