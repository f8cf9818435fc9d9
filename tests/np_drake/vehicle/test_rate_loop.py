"""Laws of an autopilot's rate loop."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake import rigid_body
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.rate_loop import RateLoop
from np_drake.vehicle.text import save_vehicle

RATES = st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array)
LOOP = RateLoop([0.05, 0.07, 0.2], [1.0, 0.9, 1.1])


@given(w=RATES, command=RATES)
def test_its_torque_gives_a_first_order_lag(w, command):
    vehicle, x = Vehicle(), np.zeros(13)
    x[3], x[10:] = 1.0, w
    u = np.concatenate([[20.0], LOOP.torque(vehicle.J, w, command)])
    al = rigid_body.state_derivative(vehicle, x, u, np.zeros(6))[10:]
    np.testing.assert_allclose(al, (np.array(LOOP.gain) * command - w) / LOOP.lag, atol=1e-9)


@given(w=RATES, al=RATES)
def test_the_command_for_an_angular_acceleration_gives_it(w, al):
    command = LOOP.command(w, al)
    np.testing.assert_allclose((np.array(LOOP.gain) * command - w) / LOOP.lag, al, atol=1e-9)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lag", [0.0, 0.1, 0.1]),
        ("lag", [50.0, 50.0, 90.0]),
        ("gain", [1.0, 1.0]),
        ("max_rate", [1e3, 1.0, 1.0]),
    ],
)
def test_impossible_values_are_refused_by_name(field, value):
    with pytest.raises(ValueError, match=f"rate_loop: {field}"):
        dc.replace(LOOP, **{field: value}).check()


def test_a_vehicle_file_keeps_it(tmp_path):
    vehicle = dc.replace(
        Vehicle(), rate_loop=LOOP, sources={"rate_loop.lag": "identified from 1 flight"}
    )
    save_vehicle(vehicle, tmp_path / "v.yaml")
    assert load_vehicle(tmp_path / "v.yaml").rate_loop == LOOP
