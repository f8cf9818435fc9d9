"""Laws of the replay of real flights in both simulators."""

import math

import pytest

from diagrams.challenge.real import replay
from diagrams.challenge.real.cases import make_cases
from diagrams.challenge.real.replay import printed
from diagrams.cli.main import run


def result(group, before, after, payload=None):
    def errors(value):
        return None if value is None else {name: [0.1 * value, value] for name in replay.QUANTITIES}

    return {
        "group": group,
        "errors": {"nominal": errors(before), "corrected": errors(after)},
        "payload": payload,
    }


def test_a_line_has_medians_at_the_last_horizon_and_counts_the_better():
    results = [result("bare", 1.0, 0.5), result("bare", 2.0, 3.0), result("bare", 4.0, 1.0)]
    (line,) = replay.lines(results)
    assert (line["position nominal"], line["position corrected"]) == (2.0, 1.0)
    assert (line["better"], line["replayed"], line["cases"]) == (2, 3, 3)


def test_flights_that_no_simulator_can_fly_are_counted_and_left_out():
    (line,) = replay.lines([result("wind", None, None), result("wind", 1.0, 0.5)])
    assert (line["cases"], line["replayed"], line["position corrected"]) == (2, 1, 0.5)
    (none,) = replay.lines([result("wind", None, None)])
    assert math.isnan(none["position nominal"])
    assert "–" in printed([none])[2][0][3]


def test_the_path_of_a_payload_counts_where_one_is_logged():
    results = [
        result("payload", 1.0, 0.5, {"below": 0.2, "swinging": 0.1}),
        result("payload", 1.0, 0.5),
    ]
    (line,) = replay.lines(results)
    assert (line["below"], line["swinging"]) == (0.2, 0.1)


def test_without_a_folder_it_says_what_to_give(monkeypatch, capsys):
    monkeypatch.delenv("NP_DRAKE_REAL", raising=False)
    assert run(["reproduce", "replay"]) == 2
    assert "NP_DRAKE_REAL" in capsys.readouterr().err


def test_a_real_payload_flight_is_nearer_to_the_corrected_simulator(real_flights):
    case = next(c for c in make_cases(real_flights, None, ["payload"]))
    found = replay.replay_case(case)
    assert "suspended_payload" in found["verdict"]
    for quantity in ("position", "velocity"):
        errors = [found["errors"][name][quantity][-1] for name in replay.SIMULATORS]
        assert errors[1] < errors[0], quantity
    assert found["payload"]["swinging"] < found["payload"]["below"]


@pytest.mark.parametrize("simulator", replay.SIMULATORS)
def test_errors_grow_with_the_horizon(real_flights, simulator):
    case = next(c for c in make_cases(real_flights, None, ["bare"]))
    found = replay.replay_case(case)
    assert found["errors"][simulator]["position"] == sorted(found["errors"][simulator]["position"])
