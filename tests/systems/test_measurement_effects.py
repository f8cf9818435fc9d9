import numpy as np
import pytest

from np_drake.effects.base import Measurement, SensorEffect
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.library import LIBRARY
from np_drake.vehicle import Vehicle
from systems.sensor_model import make_sensor_model

VEHICLE = Vehicle()
SENSORS = [e() for e in LIBRARY.values() if issubclass(e, SensorEffect) and e is not ClockOffset]


def read_by_the_rig(effects, truth):
    dut = make_sensor_model(VEHICLE, effects, period=0.02)
    context = dut.CreateDefaultContext()
    dut.GetInputPort("x_true").FixValue(context, truth.x)
    dut.GetInputPort("acceleration_true").FixValue(context, np.concatenate([truth.a, truth.al]))
    thrust = VEHICLE.thrust_coefficient * truth.rotor**2
    dut.GetInputPort("nominal_rotor_thrust").FixValue(context, thrust)
    return [dut.GetOutputPort(name).Eval(context) for name in ("x", "acceleration", "rotor_speed")]


@pytest.mark.parametrize(
    "effects", [*([e] for e in SENSORS), SENSORS], ids=lambda e: e[-1].identifier
)
def test_the_rig_reads_what_the_pure_functions_say(effects):
    rng = np.random.default_rng(0)
    x = rng.normal(size=13)
    x[3:7] /= np.linalg.norm(x[3:7])
    truth = Measurement(x, rng.normal(size=3), rng.normal(size=3), rng.uniform(500, 900, 4))
    found = read_by_the_rig(effects, truth)
    expected = truth
    for effect in effects:
        expected = effect.measure(VEHICLE, expected, np.zeros(0))
    np.testing.assert_allclose(found[0], expected.x, atol=1e-12)
    np.testing.assert_allclose(found[1], [*expected.a, *expected.al], atol=1e-12)
    np.testing.assert_allclose(found[2], truth.rotor, rtol=1e-12)
    assert np.abs(np.concatenate([found[0] - x, found[1] - [*truth.a, *truth.al]])).max() > 1e-3


def test_a_rig_cannot_shift_the_clock_and_says_who_can():
    with pytest.raises(ValueError, match=r"clock_offset.*shift_state"):
        make_sensor_model(VEHICLE, [ClockOffset(0.02)], period=0.02)
    make_sensor_model(VEHICLE, [ClockOffset(0.0)], period=0.02)
