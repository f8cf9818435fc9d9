"""Laws of the test whether something swings: a pendulum is seen, and nothing else is taken for
one.
"""

import numpy as np
import pytest

from np_drake.diagnosis.calibration import nuisance_of
from np_drake.diagnosis.doctor.smallest_sizes import evident, nearest_usual, swing_test, traces
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import tolerance_of
from np_drake.effects.suspended_payload import SuspendedPayload

EVIDENT = evident(Options.for_sensors(False).priors)


def judged(flight):
    options = Options.for_sensors(tolerance_of([flight]).real)
    near = [
        t
        for t in nearest_usual(traces([flight], options.priors))
        if t.identifier != "suspended_payload"
    ]
    others = [c.columns for c in nuisance_of([flight], options.tolerance, options.priors)] + [
        t.columns for t in near
    ]
    return swing_test(flight, others, options)


@pytest.mark.parametrize("accelerations", [True, False])
@pytest.mark.parametrize("mass, length", [(0.1, 0.5), (0.2, 1.0)])
def test_a_payload_swings_with_its_mass_and_length(seen, mass, length, accelerations):
    flight = seen(SuspendedPayload(mass, length), seed=1, noise=1.0, accelerations=accelerations)
    dut = judged(flight)
    assert dut.swings
    assert dut.mass == pytest.approx(mass, rel=0.25)  # linear in the swing
    assert dut.length == pytest.approx(length, rel=0.12)  # lengths are 9 % apart


def test_a_payload_that_is_there_in_one_flight_is_seen_in_that_alone(seen):
    factors = [
        judged(seen(*effects, seed=4, noise=1.0)).log_bayes_factor
        for effects in ((), (SuspendedPayload(0.1, 0.7),))
    ]
    assert factors[0] < 0 < EVIDENT < factors[1]
    assert np.isfinite(factors).all()
