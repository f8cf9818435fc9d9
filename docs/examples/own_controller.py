"""Flies a controller of one's own, a LeafSystem, in the place of the project's, and compares it
with nominal MPC.

Shows: the ports and parameters that a controller may have, and `fly(config, controller=…)`; what
comes back is like every other flight. `np-drake fly circle --controller own_controller.py:Feedback`
flies it too.
"""

import numpy as np
from pydrake.systems.framework import LeafSystem

from diagrams import fly, load_experiment


class Feedback(LeafSystem):
    """Thrust towards the reference, torque against tilt and body rate, both against the measured
    wrench.

    Inputs x (13,) [p_WB, q_WB, v_WB, w_WB_B], flat (15,) [p, v, a, jerk, snap of the reference] and
    label (6,) [f_e, tau_e as measured]; output u (4,) [f_u, tau_m] [N, N·m].
    """

    def __init__(self, vehicle, stiffness=6.0):
        super().__init__()
        # [1/s²]
        self._vehicle = vehicle
        self._stiffness = stiffness
        self._x = self.DeclareVectorInputPort("x", 13)
        self._flat = self.DeclareVectorInputPort("flat", 15)
        self._label = self.DeclareVectorInputPort("label", 6)
        self.DeclareVectorOutputPort("u", 4, self._calc_u)

    def _calc_u(self, context, output):
        x = self._x.Eval(context)
        flat = self._flat.Eval(context).reshape(5, 3)
        label = self._label.Eval(context)
        a = flat[2] + self._stiffness * (flat[0] - x[:3]) + 4.0 * (flat[1] - x[7:10])
        force = self._vehicle.mass * (a + [0.0, 0.0, self._vehicle.gravity]) - label[:3]
        thrust = np.linalg.norm(force)
        tilt = 0.5 * np.array([-force[1], force[0], 0.0]) / thrust
        torque = -self._vehicle.J @ (300.0 * (x[4:7] - tilt) + 24.0 * x[10:13]) - label[3:]
        output.SetFromVector([thrust, *torque])


def main() -> None:
    """Flies the circle, with a payload that neither controller knows, and prints E_xy and E_z
    [cm].
    """
    config = load_experiment("circle")
    config.duration = 2.0
    for flight in (fly(config, seed=1), fly(config, seed=1, controller=Feedback)):
        errors = flight.metrics()
        print(f"{flight.label}: {100 * errors['E_xy']:.1f}, {100 * errors['E_z']:.1f}")


if __name__ == "__main__":
    main()
