import numpy as np

from np_drake.identification.estimation import Layout, parameters
from np_drake.vehicle.published import dimensionless, published_vehicles

EVERYTHING = {"motors", "speed", "throttle", "voltage", "velocity", "accelerometer"}


def test_names_are_unique_and_deviations_positive():
    dut = parameters(600.0, 0.01)
    assert len({p.name for p in dut}) == len(dut)
    assert all(p.sd > 0 for p in dut)


def test_published_vehicles_lie_within_three_deviations_of_the_priors():
    known = {p.name: p for p in parameters(600.0, 0.01)}
    of = {
        "jxx": "inertia",
        "jyy": "inertia_pitch",
        "jzz": "inertia_yaw",
        "torque": "torque_lever",
        "lag": "time_constant",
    }
    for vehicle in published_vehicles():
        told = dimensionless(vehicle)
        for name, number in of.items():
            if number in told:
                assert abs(np.log(told[number]) - known[name].mean) < 3 * known[name].sd, (
                    vehicle.name,
                    name,
                )


def test_faster_rotors_have_proportionally_more_momentum():
    slow, fast = (
        next(p for p in parameters(s, 0.01) if p.name == "rotor_momentum") for s in (300.0, 600.0)
    )
    assert np.isclose(fast.value(0.0), 2.0 * slow.value(0.0))


def test_a_gyro_alone_tells_neither_air_nor_motors():
    dut = Layout.of(parameters(600.0, 0.01), set(), 1)
    assert {"drag", "lag", "curve", "clock", "imu_x"} <= set(dut.fixed)
