"""Laws of the published vehicles and of the spread of their dimensionless numbers."""

import csv
import dataclasses as dc
import math

import numpy as np
import pandas as pd
import pytest

from np_drake.vehicle.published import FILE, LogNormal, dimensionless, published_priors
from np_drake.vehicle.vehicle import least_torque_over_thrust

ROWS = list(csv.DictReader(FILE.read_text(encoding="utf-8").splitlines()))


def column(*names):
    """Rows of the file that tell all these figures, (n, len(names))."""
    return np.array(
        [[float(row[name]) for name in names] for row in ROWS if all(row[name] for name in names)]
    ).T


def test_the_priors_are_those_of_the_file():
    dut = published_priors()
    m, J, arm = column("mass", "inertia_xx", "arm")
    f, weight = column("max_rotor_thrust", "mass")
    k, R = column("thrust_coefficient", "rotor_radius")
    up, down = column("time_constant_up", "time_constant_down")
    x, y, z = column("inertia_xx", "inertia_yy", "inertia_zz")
    lever, radius = column("torque_over_thrust", "rotor_radius")
    I_r, mass, length = column("rotor_inertia", "mass", "arm")
    expected = {
        "thrust_to_weight": 4 * f / (9.81 * weight),
        "inertia": J / (m * arm**2),
        "inertia_pitch": y / x,
        "inertia_yaw": z / (x + y),
        "torque_lever": lever / radius,
        "thrust_number": k * (2 * np.pi) ** 2 / (1.225 * (2 * R) ** 4),
        "time_constant": up,
        "time_constant_down": down / up,
        "rotor_inertia": I_r / (mass * length**2),
    }
    assert set(expected) == {field.name for field in dc.fields(dut)}
    for name, told in expected.items():
        found = getattr(dut, name)
        logs = np.log(told)
        assert (found.count, found.mean) == (len(told), pytest.approx(logs.mean())), name
        assert found.deviation == pytest.approx(logs.std(ddof=1)), name


def test_the_published_vehicles_can_exist_and_state_their_source():
    vehicles = pd.read_csv(FILE)
    dut = dimensionless(vehicles)
    assert vehicles["name"].nunique() == len(vehicles) >= 20
    assert vehicles["source"].notna().all()
    for name, least, most in (
        ("inertia_yaw", 0.0, 1.0),  # triangle inequality
        ("inertia", 0.05, 1.0),  # at most all mass at the rotors
        ("thrust_to_weight", 1.0, 50.0),
        ("time_constant", 0.0, 0.2),  # [s]
    ):
        assert dut[name].dropna().between(least, most, inclusive="neither").all(), name
    for number, R, lever in zip(
        dut["thrust_number"], vehicles["rotor_radius"], vehicles["torque_over_thrust"], strict=True
    ):
        if np.isfinite([number, lever]).all():
            assert lever > least_torque_over_thrust(number, 2 * R)  # figure of merit below 1


def test_the_interval_of_a_logarithm_is_a_factor_to_either_side():
    dut = LogNormal(math.log(3.0), math.log(2.0), 10)
    assert dut.median == pytest.approx(3.0)
    assert dut.within(1.0) == pytest.approx((1.5, 6.0))
