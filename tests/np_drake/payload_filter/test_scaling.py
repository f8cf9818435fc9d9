"""Similar vehicles: the pendulum predictor finds the same of each, in the units of that vehicle."""

import dataclasses as dc
import math

import numpy as np
import pytest

from np_drake.lifting.model.model_file import read_tensors, write_tensors
from np_drake.payload_filter import kernel
from np_drake.payload_filter.filter_bank import BankOptions
from np_drake.payload_filter.model_file import SCHEMA, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Plan, Sample
from np_drake.vehicle.scaling import Scales

SPAN = {"horizon": 20, "stride": 2}
LENGTHS = [0.25, 4.0]  # ratios whose roots, and so all units, are powers of two


def unit_of(length: float) -> Scales:
    return Scales(length, length**3, math.sqrt(length))


def state_in(x: np.ndarray, unit: Scales) -> np.ndarray:
    """Return states (..., 13) of the paper's vehicle as those of a similar one."""
    factors = [*[unit.length] * 3, *[1.0] * 4, *[unit.speed] * 3, *[1 / unit.time] * 3]
    return x * np.array(factors)


def command_in(u: np.ndarray, unit: Scales) -> np.ndarray:
    return u * np.array([unit.force, *[unit.torque] * 3])


def sample_in(sample: Sample, unit: Scales) -> Sample:
    wrench = np.repeat([unit.force, unit.torque], 3)
    return Sample(state_in(sample.x, unit), command_in(sample.u, unit), sample.chi * wrench)


def model_in(model: PayloadFilterModel, unit: Scales) -> PayloadFilterModel:
    return dc.replace(
        model,
        step=model.step * unit.time,
        mass=model.mass * unit.mass,
        drag=model.drag / unit.time,
        drag_deviation=model.drag_deviation / unit.time,
        hook=model.hook * unit.length,
        arm=model.arm * unit.length,
    )


def ran(model: PayloadFilterModel, samples: list[Sample]) -> tuple[PayloadFilter, dict]:
    dut = PayloadFilter(model)
    memory = dut.initial_memory()
    for sample in samples:
        memory = dut.update(memory, sample)
    return dut, memory


@pytest.mark.parametrize("length", LENGTHS)
def test_similar_vehicles_see_the_same_payload_in_their_own_units(length, model, flown):
    unit, flight = unit_of(length), flown(seconds=6.0, radius=1.0, swing=0.2)
    _, paper = ran(model(), flight.samples)
    _, own = ran(model_in(model(), unit), [sample_in(sample, unit) for sample in flight.samples])
    np.testing.assert_allclose(
        own["weight"], paper["weight"], atol=1e-6
    )  # round-off of the filter [1]
    mean = own["mean"].copy()
    mean[:, kernel.RATE] *= unit.time
    mean[:, kernel.LOG_LENGTH] -= math.log(unit.length)
    mean[:, [kernel.DAMPING, kernel.DRAG]] *= unit.time
    np.testing.assert_allclose(mean, paper["mean"], atol=1e-6)
    np.testing.assert_allclose(own["steady"] / unit.torque, paper["steady"], atol=1e-9)  # [N·m]


@pytest.mark.parametrize("length", LENGTHS)
def test_similar_vehicles_foretell_the_same_wrench_in_their_own_units(length, model, flown):
    unit, flight = unit_of(length), flown(seconds=6.0, radius=1.0, swing=0.2)
    k = 200
    rows = k + 2 * np.arange(21)
    x, u = flight.x[rows], flight.u[rows[:-1]]
    wrenches = []
    for of in (unit_of(1.0), unit):
        dut, memory = ran(
            model_in(model(), of), [sample_in(sample, of) for sample in flight.samples[: k + 1]]
        )
        plan = Plan(state_in(x, of), command_in(u, of))
        found = dut.forecast_along(memory, plan, **SPAN).rollout(plan.x[:-1, 7:13])
        wrenches.append(found / np.repeat([of.force, of.torque], 3))
    np.testing.assert_allclose(
        wrenches[1], wrenches[0], atol=1e-6
    )  # round-off of the filter [N, N·m]


def test_the_papers_vehicle_keeps_the_stated_priors(model):
    assert BankOptions().scaled(model().unit) == BankOptions()


def test_a_small_vehicle_looks_for_short_tethers_that_swing_fast():
    dut, paper = BankOptions().scaled(unit_of(0.25)), BankOptions()
    assert dut.lengths == tuple(0.25 * length for length in paper.lengths)
    assert (dut.memory, dut.duration[2]) == (0.5 * paper.memory, 0.5 * paper.duration[2])
    assert (dut.drag.deviation, dut.change) == (2 * paper.drag.deviation, 2 * paper.change)
    assert dut.swing_noise[1] == 0.5 * paper.swing_noise[1]  # L² / T³
    assert (dut.push, dut.least_noise, dut.mass) == (paper.push, paper.least_noise, paper.mass)


@pytest.mark.parametrize("missing", ["arm", "delay", "hook"])
def test_a_file_that_lacks_a_number_is_refused_with_the_remedy(tmp_path, model, missing):
    path = tmp_path / "old.safetensors"
    dc.replace(model(), arm=0.05).save(path)
    assert PayloadFilterModel.load(path).arm == 0.05
    tensors, metadata = read_tensors(path, SCHEMA)
    write_tensors(
        {name: value for name, value in tensors.items() if name != missing}, metadata, path
    )
    with pytest.raises(ValueError, match=rf"^{path}: .* lacks '{missing}'; train it again$"):
        PayloadFilterModel.load(path)


def test_an_arm_must_be_positive(model):
    with pytest.raises(ValueError, match="arm must be positive"):
        dc.replace(model(), arm=0.0)
