"""Laws of the posterior of an effect's size."""

import dataclasses as dc

import numpy as np
import pytest
from scipy import stats

from np_drake.diagnosis.decision.decide import SIZE_DRAWS, SizePosterior
from np_drake.diagnosis.fitting import scaled_jacobian
from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options, Size
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL = Options.for_sensors(True)
MATERIALITY = REAL.materiality
DRAG = LinearDrag(0.3, 0.2, 0.4)
CHANCE = 4.0  # standard errors that draws may be off
UNIT = Size(MATERIALITY.force, 0.0, 0.0, 0.0)  # a force that is just material


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name="a", seconds=4.0)]


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_the_size_of_one_parameter_is_drawn_from_its_gaussian(fit_at, flights, share):
    drawn = SizePosterior(fit_at(MassError(0.2), covariance=0.2 * share), 0, flights).relative()
    assert drawn.shape == (SIZE_DRAWS,)
    test = stats.kstest(drawn, stats.foldnorm(1 / share, scale=share).cdf)  # of |1 + share n|
    assert test.pvalue > 1e-3


def test_the_size_of_several_parameters_is_the_power_of_what_they_predict(fit_at, flights):
    spread = 0.1 * np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 2.0]])
    fit = fit_at(DRAG, covariance=spread**2)
    drawn = SizePosterior(fit, 0, flights).relative()
    J = scaled_jacobian(fit.everything, fit.free, flights[0])[:, :6].reshape(-1, 3)
    power = J.T @ J
    # scales are alike
    expected = 1 + np.trace(power @ spread**2) / (fit.values @ power @ fit.values)
    error = np.std(drawn**2) / np.sqrt(SIZE_DRAWS)
    assert np.mean(drawn**2) == pytest.approx(expected, abs=CHANCE * error)


SURE = 1e-12  # variance


@pytest.mark.parametrize(
    "size, effect, matters",
    [
        (Size(1.01 * MATERIALITY.force, 0.0, 0.0, 0.0), DRAG, True),
        (Size(0.0, 1.01 * MATERIALITY.torque, 0.0, 0.0), DRAG, True),
        (Size(0.99 * MATERIALITY.force, 0.99 * MATERIALITY.torque, 0.9, 9.0), DRAG, False),
        (Size(0.0, 1.0, 1.0, 1.0), MassError(0.2), False),
        (Size(0.03, 1.0, 1.0, 1.0), MassError(0.2), True),
        (Size(0.0, 1.0, 1.0, 1.0), GyroBias(0.01, 0.0, 0.0), False),
        (Size(0.0, 1.0, 1.0, 2.0), GyroBias(0.01, 0.0, 0.0), True),
    ],
)
def test_what_matters_is_force_or_torque_and_of_a_sensor_its_tolerance(
    fit_at, flights, size, effect, matters
):
    posterior = SizePosterior(fit_at(effect, covariance=SURE), 0, flights)
    assert set(posterior.material(size, REAL)) == {matters}


@pytest.mark.parametrize("deviations, share", [(2.4, 0.0), (2.6, 1.0)])
def test_one_healthy_vehicle_in_a_hundred_is_larger(fit_at, flights, deviations, share):
    posterior = SizePosterior(fit_at(MassError(0.1 * deviations), covariance=SURE), 0, flights)
    assert np.mean(posterior.beyond({"delta_mass": (0.0, 0.1)})) == share
    assert np.mean(posterior.beyond({})) == 1.0


def options_of(lean: float, still_air: float = MATERIALITY.still_air) -> Options:
    """Options by which thrust may lean by this much, and air is still below this speed."""
    tolerance = dc.replace(REAL.tolerance, attitude=lean / MATERIALITY.sensor)
    materiality = dc.replace(MATERIALITY, still_air=still_air)
    return dc.replace(REAL, tolerance=tolerance, materiality=materiality)


def wind_at(fit_at, flights, wind, options) -> float:
    fit = fit_at(DRAG, wind, covariance=1e-3)
    return float(np.mean(SizePosterior(fit, 1, flights).wind(options)))


@pytest.mark.parametrize("speed, share", [(0.2, 0.0), (0.3, 1.0), (-3.0, 1.0)])
def test_a_mean_wind_below_a_quarter_of_a_metre_per_second_is_a_draught(
    fit_at, flights, speed, share
):
    assert wind_at(fit_at, flights, ConstantWind(0.0, speed, 0.0), options_of(0.0)) == share


@pytest.mark.parametrize("times, share", [(0.9, 0.0), (1.1, 1.0)])
def test_a_wind_pushes_harder_than_thrust_under_a_sensor_attitude_error(
    fit_at, flights, times, share
):
    (e,) = flights
    lean = 0.03
    # a drag at hover, nearly level
    speed = times * lean * e.vehicle.mass * e.vehicle.gravity / DRAG.d_x
    wind = ConstantWind(speed, 0.0, 0.0)
    assert wind_at(fit_at, flights, wind, options_of(lean, 0.0)) == share


def test_a_wind_counts_by_what_it_pushes_while_it_acts(fit_at, flights):
    (e,) = flights
    lean = 0.03
    speed = 1.2 * lean * e.vehicle.mass * e.vehicle.gravity / DRAG.d_x
    fit = fit_at(DRAG, ConstantWind(speed, 0.0, 0.0), covariance=1e-3)
    absent = dc.replace(e, log=dc.replace(e.log, name="b"))
    new = dc.replace(fit, terms=(fit.terms[0], dc.replace(fit.terms[1], onset={"b": NEVER})))
    posterior = SizePosterior(new, 1, [e, absent, absent])
    assert posterior.wind(options_of(lean, 0.0)).all()
