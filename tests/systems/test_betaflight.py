"""Laws of the firmware as a system between controller and rotors."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.loop.flight import default_flight
from diagrams.loop.flight_result import fly
from np_drake.autopilot.firmware import AutopilotError, find_firmware
from np_drake.identification.rate_loop import identify_rate_loop
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop
from systems.betaflight import BetaflightAutopilot

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())


@pytest.fixture(scope="module")
def flown():
    try:
        find_firmware()
    except AutopilotError as missing:
        pytest.skip(f"{missing} `make autopilot` runs these tests.")

    def one(kind):
        config = dc.replace(default_flight(VEHICLE), duration=18.0).with_autopilot("betaflight")
        config.controller.kind = kind
        return fly(config.check_and_step(), seed=1)

    return {kind: one(kind) for kind in ("nominal", "np")}


def test_the_vehicle_flies_on_the_firmware_and_np_flies_best(flown):
    errors = {kind: one.metrics()["E_xy"] for kind, one in flown.items()}
    assert errors["np"] < 0.4 * errors["nominal"] < 0.04


def test_motor_outputs_are_in_the_log(flown):
    log = flown["nominal"].log()
    assert log.throttle.shape == (len(log), 4)
    assert 0.4 < log.throttle.mean() < 0.9


def test_its_rate_loop_is_that_of_the_gains_it_was_given(flown):
    roll, pitch, _ = identify_rate_loop([flown["nominal"].log()])
    for loop in (roll, pitch):
        assert (
            1 / 20.0 < loop.lag < 0.1
        )  # behind the bandwidth of 20 rad/s: rotors, filters and link
        assert loop.gain == pytest.approx(1.05, abs=0.1)


@pytest.mark.parametrize("port", ["x", "acceleration", "rates_thrust"])
def test_an_input_that_is_not_finite_is_said(port):
    class Never:
        def step(self, *_):
            raise AssertionError("it must not reach the firmware")

    dut = BetaflightAutopilot(VEHICLE, Never())
    context = dut.CreateDefaultContext()
    inputs = {
        "x": np.eye(13)[3],
        "acceleration": np.zeros(6),
        "rates_thrust": np.array([20.0, 0.0, 0.0, 0.0]),
    }
    inputs[port] = np.full(len(inputs[port]), np.nan)
    for name, value in inputs.items():
        dut.GetInputPort(name).FixValue(context, value)
    with pytest.raises(RuntimeError, match="must be finite"):
        dut.EvalUniquePeriodicDiscreteUpdate(context)
