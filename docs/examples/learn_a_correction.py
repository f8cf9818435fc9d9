"""Learns a correction of the cascaded controller in Drake's `DrakeGymEnv`, 15 s on one core; needs
gymnasium.
"""

import numpy as np
from gymnasium.spaces import Box
from pydrake.gym import DrakeGymEnv
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, Multiplexer

from diagrams import add_controller, load_experiment
from diagrams.loop.flight_diagram import set_initial_state
from diagrams.loop.reality import REAL_VEHICLE, make_real_vehicle

# between two actions [s]; largest one [N, N·m]
STEP = 0.04
SPAN = np.array([5.0, 0.6, 0.6, 0.1])
ERROR = np.eye(3, 16, 13) - np.eye(3, 16)  # position error in an observation [m]


def make_env(payload: float) -> DrakeGymEnv:
    """A circle with a payload [kg] that the cascaded controller, to which the action is added, does
    not know.
    """
    config = load_experiment("circle")
    config.reality.payload.mass = payload
    config.reference.ramp = 2.0
    config.controller.kind = "cascade"
    builder = DiagramBuilder()
    vehicle = builder.AddNamedSystem(
        REAL_VEHICLE, make_real_vehicle(config.vehicle, config.reality)
    )
    cascade = add_controller(builder, config.controller, config.vehicle, config.motion, vehicle)
    command = builder.AddSystem(Adder(2, 4))
    seen = builder.AddSystem(Multiplexer([13, 3]))
    builder.Connect(cascade["u"], command.get_input_port(0))
    builder.Connect(command.get_output_port(), vehicle.GetInputPort("u"))
    builder.Connect(vehicle.GetOutputPort("x"), seen.get_input_port(0))
    builder.Connect(cascade["p_ref"], seen.get_input_port(1))
    builder.ExportInput(command.get_input_port(1), "action")
    builder.ExportOutput(seen.get_output_port(), "observation")
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(config.simulator, simulator)
    return DrakeGymEnv(
        simulator,
        time_step=STEP,
        action_space=Box(-SPAN, SPAN, dtype=np.float64),
        observation_space=Box(-np.inf, np.inf, (16,), np.float64),
        reward=lambda root, context: (
            STEP / (1.0 + 100.0 * sum((ERROR @ root.get_output_port().Eval(context)) ** 2))
        ),
        reset_handler=lambda simulator, context, seed: set_initial_state(
            simulator.get_system(), context, config
        ),
    )


def fly(env: DrakeGymEnv, gains: np.ndarray) -> float:
    """Time on the reference [s]: a step of 10 cm off counts half."""
    seen, _ = env.reset()
    total = 0.0
    for _ in range(150):
        x, y, z = ERROR @ seen
        seen, reward, *_ = env.step(
            np.clip([gains[0] + gains[1] * z, -gains[2] * y, gains[2] * x, 0.0], -SPAN, SPAN)
        )
        total += reward
    return total


def main(policies: int = 60) -> None:
    """Chooses the best of random policies on one payload and flies it with another."""
    # [N, N/m, N·m/m]
    drawn = np.random.default_rng(0).uniform(0.0, [4.0, 20.0, 0.4], (policies, 3))
    env = make_env(0.26)
    other = make_env(0.32)
    best = max(drawn, key=lambda gains: fly(env, gains))
    print(
        f"cascade: {fly(other, 0.0 * best):.2f} of 6 s; cascade + correction: "
        f"{fly(other, best):.2f} s"
    )


if __name__ == "__main__":
    main()
