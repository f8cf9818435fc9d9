"""Step response of a firmware that holds body rates, and a vehicle hovering on it."""

import dataclasses as dc

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.loop.reality import RealityConfig
from np_drake.autopilot.betaflight import PERIOD, Betaflight, BetaflightConfig
from np_drake.effects.base import ActuatorEffect
from np_drake.rigid_body import W
from np_drake.vehicle import Vehicle
from systems.betaflight import BetaflightAutopilot
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor

STEADY = 0.5  # hover before the step [s]
STEPS = (0.4, 0.4, 1.5)  # time of the step of roll, pitch and yaw [s]
SIZES = (1.0, 1.0, 0.4)  # of the step [rad/s]
SETTLED = 0.25  # share of the step's time, its last, over which the rate at rest is averaged [1]
FOLLOWED = 1 - np.exp(-1)  # of a step, after which its lag is over [1]


@dc.dataclass(frozen=True)
class StepResponse:
    """Response of one body axis to a step of its commanded rate.

    t: (n,) since the step [s].
    rate: (n,) over the step [1].
    lag: until 63 % of the step are followed [s].
    gain: rate over command at rest [1].
    largest: of the response [1].
    """

    t: np.ndarray
    rate: np.ndarray
    lag: float
    gain: float
    largest: float


def step_response(
    vehicle: Vehicle,
    axis: int,
    *,
    config: BetaflightConfig | None = None,
    effects: tuple[ActuatorEffect, ...] = (),
) -> StepResponse:
    """Return how the firmware follows a step of the commanded rate in hover, without a payload.

    Args:
        axis: 0 roll, 1 pitch, 2 yaw.
    Raises: ValueError: where there is no firmware.
    """
    with Betaflight(vehicle, config) as firmware:
        builder = DiagramBuilder()
        plant = builder.AddSystem(
            make_tethered_quadrotor(vehicle, PayloadConfig(tether="none"), actuator_effects=effects)
        )
        autopilot = builder.AddSystem(BetaflightAutopilot(vehicle, firmware))
        end = STEADY + STEPS[axis]
        hover = np.array([vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0])
        turning = hover + SIZES[axis] * np.eye(4)[1 + axis]
        commands = np.transpose([hover, turning, turning])
        source = builder.AddSystem(
            TrajectorySource(PiecewisePolynomial.ZeroOrderHold([0.0, STEADY, end + 1.0], commands))
        )
        builder.Connect(source.get_output_port(), autopilot.GetInputPort("rates_thrust"))
        for name in ("x", "acceleration"):
            builder.Connect(plant.GetOutputPort(name), autopilot.GetInputPort(name))
        builder.Connect(autopilot.GetOutputPort("u"), plant.GetInputPort("u"))
        log = LogVectorOutput(plant.GetOutputPort("x"), builder, PERIOD)
        simulator = Simulator(builder.Build())
        simulator.AdvanceTo(end)
        record = log.FindLog(simulator.get_context())
    after = record.sample_times() >= STEADY - 1e-9
    t, rate = record.sample_times()[after] - STEADY, record.data()[W][axis][after] / SIZES[axis]
    gain = float(rate[-int(SETTLED * len(rate)) :].mean())
    lag = float(np.interp(FOLLOWED * gain, np.maximum.accumulate(rate), t))
    return StepResponse(t, rate, lag, gain, float(rate.max()))


def step_responses(vehicle: Vehicle, reality: RealityConfig) -> list[StepResponse]:
    """Return the responses of roll, pitch and yaw, with the lag and thrust of a reality's rotors.

    Args:
        reality: whose rotors it has; dead times are left out.
    Raises: ValueError: where there is no firmware.
    """
    effects = tuple(effect for effect in reality.actuator_effects() if effect.dead_time == 0.0)
    return [step_response(vehicle, axis, effects=effects) for axis in range(3)]
