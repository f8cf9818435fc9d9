import numpy as np
import pytest

from np_drake.residual_model import Sample
from np_drake.residual_models.failing import Failing
from np_drake.residual_models.hold import Hold

STEP, ONSET = 0.02, 0.2  # [s]


def forecasts(model, samples=20):
    """(samples, 6) first wrench after each of a course of rising labels."""
    memory, found = model.initial_memory(), []
    for k in range(samples):
        memory = model.update(memory, Sample(np.zeros(13), np.zeros(4), np.full(6, 1.0 + k)))
        found.append(model.forecast(memory, horizon=5, stride=2).first)
    return np.array(found)


@pytest.mark.parametrize("fault", ["zero", "frozen"])
def test_until_the_onset_nothing_is_missed(fault):
    sound = forecasts(Hold(step=STEP))
    dut = forecasts(Failing(Hold(step=STEP), fault=fault, onset=ONSET))
    lost = round(ONSET / STEP)  # sample k comes at t = k STEP
    np.testing.assert_array_equal(dut[:lost], sound[:lost])
    assert (dut[lost:] != sound[lost:]).all()


def test_a_predictor_at_zero_leaves_the_nominal_model():
    dut = forecasts(Failing(Hold(step=STEP), fault="zero", onset=ONSET))
    assert not dut[round(ONSET / STEP) :].any()


def test_a_frozen_predictor_repeats_its_last_forecast():
    dut = forecasts(Failing(Hold(step=STEP), fault="frozen", onset=ONSET))
    last = round(ONSET / STEP) - 1
    np.testing.assert_array_equal(dut[last:], np.tile(dut[last], (len(dut) - last, 1)))
    assert dut[last].any()


def test_two_memories_of_one_model_do_not_meet():
    model = Failing(Hold(step=STEP), fault="zero", onset=ONSET)
    first = forecasts(model)
    np.testing.assert_array_equal(forecasts(model), first)


@pytest.mark.parametrize("bad", [{"fault": "late", "onset": 1.0}, {"fault": "zero", "onset": -1.0}])
def test_an_unknown_fault_is_refused(bad):
    with pytest.raises(ValueError, match="Failing: "):
        Failing(Hold(step=STEP), **bad)
