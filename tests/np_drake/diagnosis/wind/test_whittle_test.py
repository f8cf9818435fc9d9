import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FORCE
from np_drake.diagnosis.slow_force import _markov, _slow_power, slow_force
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
THRESHOLDS = REAL.thresholds

DRAG = LinearDrag(0.3, 0.3, 0.3)


def flown(seen, *effects, seconds=30.0, **how):
    return [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds, **how) for i in (1, 2)]


def left_of(flights, *effects):
    return {
        e.name: e.y - predicted_residual(e, [Term(effect) for effect in effects]) for e in flights
    }


@pytest.mark.parametrize("time", [0.5, 1.5])
def test_gusts_are_a_force_in_the_air(seen, time):
    flights = flown(seen, DRAG, GustyWind(0.0, 0.0, 0.0, 1.5, time, seed=4))
    evidence, deviation = slow_force(flights, left_of(flights, DRAG), IDEAL)
    assert evidence > THRESHOLDS.slow_force_evidence + 5.0
    assert deviation == pytest.approx(0.45, rel=0.4)


@settings(max_examples=20, deadline=None)
@given(st.floats(-4.0, 1.0), st.floats(-1.5, 2.0))
def test_the_spectrum_of_a_gauss_markov_process_holds_its_variance(rms, time):
    f = np.geomspace(1e-5, 1e5, 20001) / np.exp(time)
    assert integrate.trapezoid(_markov(f, rms, time), f) == pytest.approx(np.exp(2 * rms), rel=0.01)


def test_a_slow_force_has_its_mean_square_as_power_and_a_fast_one_none(seen):
    flights = flown(seen, seconds=20.0)
    for frequency, expected in ((0.3, 0.5 * 0.8**2), (4.0, 0.0)):
        residual = {}
        for e in flights:
            level = 0.8 * np.sin(2 * np.pi * frequency * e.t)
            force = attitude.rotate_back(e.q, np.column_stack([level, level, 0 * level]))
            residual[e.name] = np.zeros_like(e.y)
            residual[e.name][:, FORCE] = force
        assert _slow_power(flights, residual) == pytest.approx(expected, rel=0.1, abs=0.01)
