import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.mpc.dynamics import Actuation, DiscreteDynamics
from np_drake.rigid_body import state_derivative
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

SKEWED = Vehicle(
    inertia=[[0.02, 0.001, 0.002], [0.001, 0.025, -0.001], [0.002, -0.001, 0.035]]
).check()
STEP = 0.04


def runge_kutta(vehicle, x, u, chi):
    k1 = state_derivative(vehicle, x, u, chi)
    k2 = state_derivative(vehicle, x + STEP / 2 * k1, u, chi)
    k3 = state_derivative(vehicle, x + STEP / 2 * k2, u, chi)
    k4 = state_derivative(vehicle, x + STEP * k3, u, chi)
    return x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def random_stages(seed, n=3):
    rng = np.random.default_rng(seed)
    u = [20.0, 0.0, 0.0, 0.0] + rng.normal(size=(n, 4)) * [8.0, 0.5, 0.5, 0.1]
    return rng.normal(size=(n, 13)), u, rng.normal(size=(n, 6))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), skewed=st.booleans())
def test_value_is_one_runge_kutta_step_of_eq_1(seed, skewed):
    vehicle = SKEWED if skewed else Vehicle().check()
    x, u, chi = random_stages(seed)
    dut = DiscreteDynamics(vehicle, STEP)
    found = [
        dut.advance(*stage) for stage in zip(x.tolist(), u.tolist(), chi.tolist(), strict=True)
    ]
    np.testing.assert_allclose(found, runge_kutta(vehicle, x, u, chi), atol=1e-11)  # round-off


@pytest.mark.parametrize("command", ["rotors", "rates"])
def test_jacobians_match_finite_differences(command):
    loop = RateLoop([0.05, 0.07, 0.2], [1.0, 0.9, 1.1])
    by = Actuation.of(dc.replace(SKEWED, rate_loop=loop), command)
    (x, u, chi), dynamics = random_stages(5), DiscreteDynamics(SKEWED, STEP, by)
    dut = dynamics.linearise(x, u, chi)
    values = np.concatenate([x, chi, u], axis=1)

    def step(values):
        return np.array([dynamics.advance(y[:13], y[19:], y[13:19]) for y in values])

    eps = 1e-6
    numeric = np.stack(
        [(step(values + eps * e) - step(values - eps * e)) / (2 * eps) for e in np.eye(23)], axis=2
    )
    np.testing.assert_allclose(dut.Fx, numeric[:, :, :19], atol=1e-7)  # central differences
    np.testing.assert_allclose(dut.Fu, numeric[:, :, 19:], atol=1e-7)
