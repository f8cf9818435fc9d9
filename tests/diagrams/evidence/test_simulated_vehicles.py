"""Laws of `np-drake reproduce identification`."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.evidence.simulated_vehicles import draw_truth, pooled_lines, quantity_lines
from np_drake.identification.quantities import QUANTITIES


def test_every_quantity_stands_beside_the_truth_and_the_prior(tmp_path):
    written = tmp_path / "a.json"
    command = ["reproduce", "identification", "--vehicles", "1", "--flights", "1", "--seconds", "8"]
    assert run([*command, "--jobs", "1", "--seed", "7", "--json", str(written)]) == 0
    (record,) = json.loads(written.read_text())["runs"]
    assert record["case"] == {"seed": 7, "kind": "rotor_speed"}
    quantities = {q["name"]: q for q in record["result"]["quantities"]}
    assert not {"transport delay", "thrust at full throttle"} & {*quantities}
    inertia = quantities["inertia xx"]
    assert inertia["told"]
    assert inertia["within"] == (inertia["ci95"][0] <= inertia["true"] <= inertia["ci95"][1])
    assert inertia["error"] < inertia["prior_error"]


@pytest.mark.parametrize("kind", ["rotor_speed", "throttle", "command"])
def test_a_truth_has_the_quantities_of_its_vehicle(kind):
    truth = draw_truth(np.random.default_rng(5), kind)
    true, v = {q.name: truth.value_of(q) for q in QUANTITIES}, truth.vehicle
    assert true["inertia xy"] == v.J[0, 1]
    assert true["centre of mass y"] == v.calibration.center_of_mass[1]
    assert true["drag, lateral"] == truth.drag.d_x / v.mass
    assert true["transport delay"] == v.calibration.command_delay
    assert true["idle speed over full speed"] is None
    assert truth.known.mass == v.mass
    assert truth.known.calibration.rotor_gains == [1.0] * 4


def result(kind, *within, told=True, names=("transport delay",) * 9):
    """Result of a vehicle whose delays are 1 ms off."""
    q = {"unit": "ms", "air": False, "told": told, "error": 1.0, "prior_error": 4.0}
    quantities = [
        {**q, "name": name, "within": inside} for name, inside in zip(names, within, strict=False)
    ]
    return {"kind": kind, "refused": 1, "processor_time": 6.0, "quantities": quantities}


def test_what_is_not_told_counts_in_no_interval():
    untold = result("throttle", False, told=False)
    (line,) = quantity_lines([result("throttle", True, True), untold])
    assert (line["count"], line["told"], line["within"]) == (3, 2, 1.0)
    assert (line["error"], line["prior_error"]) == (1.0, 4.0)


def test_quantities_of_one_kind_share_a_line():
    both = result("throttle", True, False, names=("time constant up", "time constant down"))
    (line,) = quantity_lines([both])
    assert (line["name"], line["count"], line["within"]) == ("time constants up, down", 2, 0.5)


def test_vehicles_are_pooled_and_stand_by_input():
    flown = [result("rotor_speed", True), result("throttle", True, False)]
    every, rotor, throttle = pooled_lines(flown)
    assert every["vehicle"] == pytest.approx(2 / 3)
    # Variance of a ratio of sums over vehicles: residuals 1 - 2/3 and 1 - 4/3.
    assert every["vehicle_ci95"] == pytest.approx(1.96 * np.sqrt(2 * 2 / 9) / 3)
    assert (rotor["vehicle"], throttle["vehicle"]) == (1.0, 0.5)
    assert (every["refused"], every["air"]) == (2, None)
