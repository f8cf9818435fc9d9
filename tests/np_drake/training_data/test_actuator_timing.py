"""Laws of the rotor lag that flight logs show."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import labels, rigid_body
from np_drake.flight_log import FlightLog
from np_drake.lifting.training.train import make_config
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.residual_models.predictor_training import train_on_flights
from np_drake.training_data.actuator_timing import delayed, learned_timing
from np_drake.training_data.segments import Flight
from np_drake.vehicle import Vehicle

STEP = 0.02  # [s]


def flight(lag: float, *, noise: float = 0.0, n: int = 1500) -> FlightLog:
    """A log under a slow wrench and a restless command that acts through `lag` [s]; noise of a
    [m/s²].
    """
    draw, t = np.random.default_rng(0), STEP * np.arange(n)
    u = np.array([20.0, 0, 0, 0]) + draw.normal(size=(n, 4)) * [1.0, 0.1, 0.1, 0.02]
    still = np.tile([1.0, 0, 0, 0], (n, 1))
    log = FlightLog(t=t, p=np.zeros((n, 3)), q=still, v=np.zeros((n, 3)), w=np.zeros((n, 3)), u=u)
    chi = np.outer(np.sin(3.5 * t), [1.0, 0.5, 1.0, 0.02, 0.02, 0.0]) - [0, 0, 2.5, 0, 0, 0]
    set_accelerations(log, log, lag, chi)
    log.a += noise * draw.normal(size=(n, 3))
    log.al += 5 * noise * draw.normal(size=(n, 3))
    return log


def set_accelerations(log: FlightLog, commanded: FlightLog, lag: float, chi=np.zeros(6)):  # noqa: B008
    """Set those under the commands of another log, which act through `lag` [s], and a wrench."""
    acting = labels.acting_command(commanded, Vehicle(rotor_time_constant=lag))
    rate = rigid_body.state_derivative(
        Vehicle(), log.x, acting, np.broadcast_to(chi, (len(log), 6))
    )
    log.a, log.al = rate[:, 7:10].copy(), rate[:, 10:13].copy()


@pytest.mark.parametrize(
    ("name", "label", "delay"),
    [("paper", labels.default_labels(Vehicle()), None), ("neural-lpv", labels.RAW, 0)],
)
def test_a_predictor_knows_how_its_labels_were_made(name, label, delay):
    config, flights = make_config(name, epochs=1), [Flight(flight(0.03, noise=0.1), Vehicle())]
    dut = LiftedLinearPredictor.of(train_on_flights(flights, config, step=STEP).model)
    assert dut.rotor_lag == pytest.approx(0.03, abs=0.003)  # [s]
    assert (dut.label, dut.delay) == (label, delay)


def test_a_command_whose_lag_would_have_no_end_tells_none():
    log = flight(0.0)
    wave = np.sin(6.0 * log.t)
    log.u = np.column_stack([20.0 + wave, 0.1 * wave, 0.1 * wave, np.zeros(len(log))])
    set_accelerations(log, log, 0.5)  # far beyond the longest that is looked for
    assert learned_timing([(log, Vehicle())], [0.0])[0] == 0.0


@pytest.mark.parametrize("delay", [0.0, 0.05])
@pytest.mark.parametrize("lag", [0.0, 0.03])
def test_delay_and_lag_are_found_together(lag, delay):
    log = flight(lag, noise=0.1)
    log.u = flight(0.0).u
    set_accelerations(log, delayed(log, delay), lag)
    found = learned_timing([(log, Vehicle())], [0.005 * i for i in range(25)])
    assert found == (pytest.approx(lag, abs=0.003), pytest.approx(delay, abs=0.0051))  # [s]


def test_a_named_lag_and_measured_rotors_are_believed():
    named, log = Vehicle(rotor_time_constant=0.03), flight(0.03)
    measured = dc.replace(log, input="rotor_speed"), Vehicle()
    assert learned_timing([measured], [0.0, 0.02]) == (0.0, 0.0)
    set_accelerations(log, delayed(log, 0.04), 0.03)
    assert learned_timing([(log, named), measured], [0.0, 0.02, 0.04, 0.06]) == (0.0, 0.04)
