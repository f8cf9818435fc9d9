"""Laws of the posterior of an effect's size."""

import dataclasses as dc

import numpy as np
import pytest
from scipy import stats

from np_drake.diagnosis.decision.term_assessment import (
    DRAWS,
    material_share,
    relative_sizes,
    wind_share,
)
from np_drake.diagnosis.fitting import scaled_jacobian
from np_drake.diagnosis.forward_model import NEVER
from np_drake.diagnosis.options import Options, Size
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL = Options.for_sensors(True)
MATERIALITY = REAL.materiality
PLAIN = {"calibration": False, "sensor": False}
DRAG = LinearDrag(0.3, 0.2, 0.4)
CHANCE = 4.0  # standard errors that draws may be off
UNIT = Size(MATERIALITY.force, 0.0, 0.0, 0.0)  # a force that is just material


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name="a", seconds=4.0)]


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_the_size_of_one_parameter_is_drawn_from_its_gaussian(fit_at, flights, share):
    drawn = relative_sizes(fit_at(MassError(0.2), covariance=0.2 * share), 0, flights)
    assert drawn.shape == (DRAWS,)
    test = stats.kstest(drawn, stats.foldnorm(1 / share, scale=share).cdf)  # of |1 + share n|
    assert test.pvalue > 1e-3


def test_the_size_of_several_parameters_is_the_power_of_what_they_predict(fit_at, flights):
    spread = 0.1 * np.array([[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 2.0]])
    fit = fit_at(DRAG, covariance=spread**2)
    drawn = relative_sizes(fit, 0, flights)
    J = scaled_jacobian(fit.everything, fit.free, flights[0])[:, :6].reshape(-1, 3)
    power = J.T @ J
    # scales are alike
    expected = 1 + np.trace(power @ spread**2) / (fit.values @ power @ fit.values)
    error = np.std(drawn**2) / np.sqrt(DRAWS)
    assert np.mean(drawn**2) == pytest.approx(expected, abs=CHANCE * error)


@pytest.mark.parametrize("times", [0.8, 1.0, 1.1])
def test_between_the_limits_it_is_the_gaussian_above_the_bound(times):
    deviation = 0.2
    drawn = 1 + deviation * stats.norm.ppf((np.arange(1000) + 0.5) / 1000)
    size = dc.replace(UNIT, force=times * UNIT.force)
    expected = stats.norm.sf((1 / times - 1) / deviation)
    assert material_share(size, drawn, MATERIALITY, **PLAIN) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(
    "size, kind, matters",
    [
        (UNIT, {}, True),
        (dc.replace(UNIT, force=0.0, torque=1.01 * MATERIALITY.torque), {}, True),
        (Size(0.99 * MATERIALITY.force, 0.99 * MATERIALITY.torque, 0.9, 9.0), {}, False),
        (Size(0.0, 1.0, 1.0, 1.0), {"calibration": True}, False),
        (Size(0.03, 1.0, 1.0, 1.0), {"calibration": True}, True),
        (Size(0.0, 1.0, 1.0, 1.0), {"sensor": True}, False),
        (Size(0.0, 1.0, 1.0, 2.0), {"sensor": True}, True),
    ],
)
def test_what_matters_is_force_or_torque_and_of_a_sensor_its_tolerance(size, kind, matters):
    assert material_share(size, np.ones(1), MATERIALITY, **(PLAIN | kind)) == matters


def wind_at(
    fit_at, flights, wind, still_air=MATERIALITY.still_air, lean=0.0, covariance=1e-3
) -> float:
    return wind_share(fit_at(DRAG, wind, covariance=covariance), 1, flights, still_air, lean)


@pytest.mark.parametrize("speed, share", [(0.2, 0.0), (0.3, 1.0), (-3.0, 1.0)])
def test_a_mean_wind_below_a_quarter_of_a_metre_per_second_is_a_draught(
    fit_at, flights, speed, share
):
    assert wind_at(fit_at, flights, ConstantWind(0.0, speed, 0.0)) == share


@pytest.mark.parametrize("times, share", [(0.9, 0.0), (1.1, 1.0)])
def test_a_wind_pushes_harder_than_thrust_under_a_sensor_attitude_error(
    fit_at, flights, times, share
):
    (e,) = flights
    lean = 0.03
    # a drag at hover, nearly level
    speed = times * lean * e.vehicle.mass * e.vehicle.gravity / DRAG.d_x
    assert wind_at(fit_at, flights, ConstantWind(speed, 0.0, 0.0), 0.0, lean) == share


def test_a_wind_counts_by_what_it_pushes_while_it_acts(fit_at, flights):
    (e,) = flights
    lean = 0.03
    speed = 1.2 * lean * e.vehicle.mass * e.vehicle.gravity / DRAG.d_x
    fit = fit_at(DRAG, ConstantWind(speed, 0.0, 0.0), covariance=1e-3)
    absent = dc.replace(e, log=dc.replace(e.log, name="b"))
    new = dc.replace(fit, terms=(fit.terms[0], dc.replace(fit.terms[1], onset={"b": NEVER})))
    assert wind_share(new, 1, [e, absent, absent], 0.0, lean) == 1.0
