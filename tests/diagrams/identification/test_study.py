"""Laws of `np-drake reproduce identification`."""

import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.identification.coverage import asked_lines, pooled_lines, quantity_lines
from diagrams.identification.simulated import INPUTS, draw_truth
from diagrams.identification.vehicle_case import make_cases, refused_draws


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    """Written report of one vehicle, and the command."""
    folder = tmp_path_factory.mktemp("study")
    command = [
        "reproduce",
        "identification",
        "--vehicles",
        "1",
        "--flights",
        "1",
        "--seconds",
        "8",
        "--jobs",
        "1",
    ]
    command += ["--seed", "7", "--out", str(folder / "out"), "--json", str(folder / "a.json")]
    assert run(command) == 0
    return command, folder / "a.json"


def test_every_quantity_stands_beside_the_truth_and_naive_answers(studied):
    (record,) = json.loads(studied[1].read_text())["runs"]
    quantities = {q["name"]: q for q in record["result"]["quantities"]}
    inertia = quantities["inertia xx"]
    assert inertia["told"]
    assert inertia["within"] == (inertia["ci95"][0] <= inertia["true"] <= inertia["ci95"][1])
    assert inertia["error"] < inertia["prior_error"]
    assert inertia["plain_error"] is not None
    assert quantities["inertia xy"]["plain_error"] is None  # plain least squares is not told of it


def test_a_study_goes_on_from_its_cases(studied, tmp_path):
    command, written = studied
    assert run([*command[:-1], str(tmp_path / "b.json")]) == 0
    first, second = (json.loads(path.read_text()) for path in (written, tmp_path / "b.json"))
    assert first["runs"] == second["runs"]


def test_inputs_take_turns_and_every_vehicle_has_a_seed():
    cases = make_cases(4, 5800)
    assert [case["seed"] for case in cases] == [5800, 5801, 5802, 5803]
    assert [case["kind"] for case in cases] == [*INPUTS, INPUTS[0]]


def test_draws_that_cannot_be_flown_are_counted():
    truth = draw_truth(np.random.default_rng((7, 2)), "throttle")  # the third draw of this seed
    assert refused_draws(7, truth) == 2
    with pytest.raises(ValueError, match="none of seed 8"):
        refused_draws(8, truth)


def result(kind, *within, told=True):
    """Result of a vehicle whose delays are 1 ms off."""
    q = {
        "name": "transport delay",
        "unit": "ms",
        "air": False,
        "told": told,
        "error": 1.0,
        "prior_error": 4.0,
    }
    return {
        "kind": kind,
        "refused": 1,
        "processor_time": 6.0,
        "quantities": [{**q, "plain_error": None, "within": inside} for inside in within],
    }


def test_what_is_not_told_counts_in_no_interval():
    (line,) = quantity_lines(
        [result("throttle", True, True), result("throttle", False, told=False)]
    )
    assert (line["count"], line["told"], line["within"]) == (3, 2, 1.0)


def test_quantities_of_one_kind_share_a_line():
    both = result("throttle", True, False)
    for q, name in zip(both["quantities"], ("time constant up", "time constant down"), strict=True):
        q["name"] = name
    (line,) = quantity_lines([both])
    assert (line["name"], line["count"], line["within"]) == ("time constants up, down", 2, 0.5)


def test_vehicles_are_pooled_and_stand_by_input():
    every, rotor, throttle = pooled_lines(
        [result("rotor_speed", True), result("throttle", True, False)]
    )
    assert every["vehicle"] == pytest.approx(2 / 3)
    assert (rotor["vehicle"], throttle["vehicle"]) == (1.0, 0.5)
    assert (every["refused"], every["air"]) == (2, None)


def test_what_was_asked_stands_beside_what_was_seen():
    lines = {line["figure"]: line for line in asked_lines([result("throttle", True, True)])}
    assert lines["delay, median error"]["met"]
    assert not lines["processor time, median"]["met"]
    assert not lines["95 % interval holds the truth, quantities of the vehicle file"][
        "met"
    ]  # too wide is no success
    assert not lines["motor lag, median error"]["met"]  # nothing was seen
