"""Laws of readings as `diagnosis.json` holds them."""

import json

import numpy as np

from np_drake.diagnosis.numerics import Readings, scale_only
from np_drake.diagnosis.options import Tolerance


def test_readings_whiten_as_before():
    values = np.random.default_rng(1).normal(size=(50, 15))
    told = Readings(scale_only([values], 0.02), Tolerance(mass=0.01))
    dut = Readings.of_json(json.loads(json.dumps(told.as_json())))
    assert dut.tolerance == told.tolerance
    np.testing.assert_array_equal(dut.noise.whiten(values), told.noise.whiten(values))
