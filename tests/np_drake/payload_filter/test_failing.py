import numpy as np

from np_drake.labels import ReadsLabels
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Plan, ReadsPlan
from np_drake.residual_models.failing import Failing


def test_a_model_that_reads_a_plan_and_raw_labels_goes_on_doing_so_until_it_fails(model, flown):
    inner = PayloadFilter(model())
    dut = Failing(inner, fault="zero", onset=1.0)
    assert isinstance(dut, ReadsPlan)
    assert isinstance(dut, ReadsLabels)
    assert dut.label == inner.label
    plain, wrapped = inner.initial_memory(), dut.initial_memory()
    flight = flown(seconds=2.0)
    plan = Plan(flight.x[:21], flight.u[:20])
    for k, sample in enumerate(flight.samples):
        plain, wrapped = inner.update(plain, sample), dut.update(wrapped, sample)
        along = dut.forecast_along(wrapped, plan, horizon=20, stride=1).first
        expected = inner.forecast_along(plain, plan, horizon=20, stride=1).first if k < 50 else np.zeros(6)
        np.testing.assert_array_equal(along, expected)
