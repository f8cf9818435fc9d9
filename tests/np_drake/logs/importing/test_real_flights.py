"""Laws of imported real flights: rotors carry a vehicle with nothing attached, and a payload pulls
on it.
"""

import dataclasses as dc

import pytest

from np_drake.diagnosis.doctor.examine import examine
from np_drake.finding import Kind
from np_drake.logs.importing.log_map import load_map_file
from np_drake.logs.opening import open_flights
from np_drake.logs.rotors import rotor_orders, torques_seen
from np_drake.vehicle import load_vehicle

CRAZYFLIES = [  # flight, preset, mass [kg], map
    ("imrc/bare/eckart13", "crazyflie_brushless", 0.037, None),
    ("idsia/square_20251017_run4.parquet", "crazyflie_brushless", 0.045, "idsia"),
]


@pytest.mark.parametrize(
    "name, preset, mass, log_map", CRAZYFLIES, ids=[name for name, *_ in CRAZYFLIES]
)
def test_a_crazyflies_log_fits_its_preset_in_order_and_weight(
    real_flights, name, preset, mass, log_map
):
    vehicle = load_vehicle(preset).with_mass(mass)
    log_map = log_map and load_map_file(log_map)
    flights, _ = open_flights(real_flights / name, vehicle, log_map)
    for log in flights:
        if found := rotor_orders(torques_seen([log], vehicle).get(None, ()), vehicle):
            assert found[0] == found[1][0]
        assert not any(f.kind is Kind.ROTOR_ORDER for f in log.findings)
    report = examine(flights, vehicle)
    assert report.usable
    assert max(report.residual_force.values()) < 0.25
    order = (3, 0, 1, 2)
    turned = dc.replace(
        vehicle,
        rotor_positions=[vehicle.rotor_positions[i] for i in order],
        rotor_directions=[vehicle.rotor_directions[i] for i in order],
    )
    (again, *_), _ = open_flights(real_flights / name, turned, log_map)
    assert any(f.kind is Kind.ROTOR_ORDER for f in again.findings)
