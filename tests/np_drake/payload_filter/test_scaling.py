"""Similar vehicles find the same in their own units; the file that carries what is known."""

import dataclasses as dc
import math

import numpy as np
import pytest

from np_drake.payload_filter import kernel
from np_drake.payload_filter.bank_options import BankOptions, Prior
from np_drake.payload_filter.kernel import PARAMETERS, POINT, weigh_bank
from np_drake.payload_filter.model_file import SCHEMA, PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.residual_model import Plan, Sample
from np_drake.trained_model import read_tensors, write_model
from np_drake.vehicle.scaling import Scales
from tests.np_drake.payload_filter.conftest import flown, model


def unit_of(length: float) -> Scales:
    return Scales(length, length**3, math.sqrt(length))


def flown_as(model: PayloadFilterModel, flight, unit: Scales):
    """Memory and wrench forecast (20, 6) of a similar vehicle on the same flight."""
    state = np.repeat([unit.length, 1.0, unit.length / unit.time, 1 / unit.time], [3, 4, 3, 3])
    command = np.repeat([unit.force, unit.torque], [1, 3])
    wrench = np.repeat([unit.force, unit.torque], 3)
    scaled = {"step": unit.time, "mass": unit.mass, "hook": unit.length, "arm": unit.length}
    scaled |= {"drag": 1 / unit.time, "drag_deviation": 1 / unit.time}
    values = {name: getattr(model, name) * factor for name, factor in scaled.items()}
    dut = PayloadFilter(dc.replace(model, **values))
    memory, k = dut.initial_memory(), 200
    for s in flight.samples[: k + 1]:
        memory = dut.update(memory, Sample(s.x * state, s.u * command, s.chi * wrench))
    rows = k + 2 * np.arange(21)
    plan = Plan(flight.x[rows] * state, flight.u[rows[:-1]] * command)
    found = dut.forecast_along(memory, plan, horizon=20, stride=2).rollout(plan.x[:-1, 7:13])
    return memory, found / wrench


@pytest.mark.parametrize("length", [0.25, 4.0])  # whose roots, and so all units, are powers of two
def test_similar_vehicles_see_the_same_payload_in_their_own_units(length):
    unit, flight = unit_of(length), flown(seconds=6.0, radius=1.0, swing=0.2)
    paper, expected = flown_as(model(), flight, unit_of(1.0))
    own, found = flown_as(model(), flight, unit)
    # Round-off of the filter [1, N, N·m]
    np.testing.assert_allclose(own["weight"], paper["weight"], atol=1e-6)
    mean = own["mean"].copy()
    mean[:, kernel.RATE] *= unit.time
    mean[:, kernel.LOG_LENGTH] -= math.log(unit.length)
    mean[:, [kernel.DAMPING, kernel.DRAG]] *= unit.time
    np.testing.assert_allclose(mean, paper["mean"], atol=1e-6)
    np.testing.assert_allclose(own["steady"] / unit.torque, paper["steady"], atol=1e-9)
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_small_vehicle_looks_for_short_tethers_that_swing_fast():
    paper = BankOptions()
    assert paper.scaled(model().unit) == paper
    dut = paper.scaled(unit_of(0.25))
    assert dut.lengths == tuple(0.25 * length for length in paper.lengths)
    for name in ("memory", "duration", "push_time"):
        assert getattr(dut, name) == tuple(0.5 * time for time in getattr(paper, name))
    assert (dut.drag.deviation, dut.change) == (2 * paper.drag.deviation, 2 * paper.change)
    assert dut.swing_noise[1] == 0.5 * paper.swing_noise[1]  # L² / T³
    assert (dut.push, dut.least_noise, dut.mass) == (paper.push, paper.least_noise, paper.mass)


def test_a_model_file_gives_back_the_model_and_lacks_nothing(tmp_path):
    path, learned = tmp_path / "m.safetensors", {"bank": FEW, "learned": {"flights": 3}}
    before = dc.replace(model(), arm=0.05, summary={"samples": 3}, **learned)
    before.save(path)
    after = PayloadFilterModel.load(path)
    assert all(np.array_equal(vars(after)[name], value) for name, value in vars(before).items())
    tensors, header = read_tensors(path, SCHEMA)
    for missing in ("arm", "delay", "hook", "bank"):
        kept = {name: value for name, value in tensors.items() if name != missing}
        kinds = {name: value for name, value in header.items() if name != missing}
        write_model(kept, SCHEMA, kinds, path)
        with pytest.raises(ValueError, match=rf"^{path}: .* lacks '{missing}'; train it again$"):
            PayloadFilterModel.load(path)


FEW = BankOptions(lengths=(0.4, 0.9), mass=Prior(0.3, 0.4), push=(1, 2, 3, 4), bare=0.25)
FIRST = np.array([0.5, 0.3, 0.2])


def weighed(weight, likelihood, *, at=None, stay=1.0):
    mean, spread = np.zeros((3, POINT)) if at is None else at, (np.zeros((3, 8)), np.ones((3, 8)))
    return weigh_bank(np.array(weight), np.array(likelihood), mean, *spread, FIRST, stay)


def test_without_changes_the_weights_are_those_of_bayes():
    weight, likelihood = np.array([0.2, 0.5, 0.3]), np.array([-1.0, 0.5, 2.0])
    wanted = weight * np.exp(likelihood)
    for shift in (0.0, -2000.0):
        found = weighed(weight, likelihood + shift)
        np.testing.assert_allclose(found, wanted / wanted.sum(), rtol=1e-9)


def test_a_member_without_weight_returns_with_the_share_drawn_anew():
    found = weighed([1.0, 0.0, 0.0], np.zeros(3), stay=0.9)
    np.testing.assert_allclose(found, [0.9 + 0.05, 0.03, 0.02], rtol=1e-12)
    far = np.zeros((3, POINT))
    far[1, PARAMETERS] = 2.0  # two deviations in each of eight parameters
    wanted = [0.9, 0.0, 0.0] + 0.1 * FIRST * [1.0, np.exp(-16.0), 1.0]
    found = weighed([1.0, 0, 0], np.zeros(3), at=far, stay=0.9)
    np.testing.assert_allclose(found, wanted / wanted.sum(), rtol=1e-9)
