"""Laws of the campaign with faults."""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.loop.flight_diagram import NO_FAULTS
from diagrams.loop.flight_result import simulate
from diagrams.robustness.faults.campaign import (
    BACK,
    ROWS,
    TRAINED,
    Flying,
    case_faults,
    fault_cases,
    flight_config,
    measures,
    oracle_cases,
    reaching,
)
from diagrams.robustness.faults.fault import Fault, apply
from diagrams.robustness.faults.kinds import KIND, KINDS
from diagrams.robustness.faults.study import faults_figure
from diagrams.robustness.faults.table import OURS, PHYSICS, by_controller, by_fault, verdicts
from diagrams.tracking.tracking import named

MODELS = {row.configuration: b"a model file" for row in TRAINED}
CASES = fault_cases(range(3000), ROWS, MODELS)


def faulty(row, kind, duration=None, **values):
    faults = [dc.asdict(Fault(kind, 3.0, duration, values))]
    return Flying({}, "sqp")({"row": row, "model": "", "faults": faults, "seed": 9600})


def record(row, seed, lost_at=None, recovery=0.0, kind="wind step"):
    result = {"lost_at": lost_at, "recovery": recovery, "gave_up": False, "nan_commands": 0}
    fault = {"kind": kind, "onset": 3.0, "duration": None, "values": {}}
    return {"case": {"row": row, "seed": seed, "model": "", "faults": [fault]}, "result": result}


def test_a_draw_depends_on_its_seed_alone():
    assert fault_cases([7], ROWS, MODELS) == [CASES[7]]
    assert json.loads(json.dumps(CASES[:50])) == CASES[:50]  # as they come back from a file


def test_every_kind_and_every_controller_is_drawn_as_often_as_stated():
    rows = [case["row"] for case in CASES]
    kinds = [fault.kind for case in CASES for fault in case_faults(case)]
    for row in ROWS:  # four standard errors of 3000 draws [1]
        assert rows.count(row.name) / len(rows) == pytest.approx(1 / len(ROWS), abs=0.023)
    for kind in KINDS:
        share = kinds.count(kind.name) / len(kinds)
        assert share == pytest.approx(1 / len(KINDS), abs=0.02)  # four errors, and what no cascade can meet
    assert np.mean([len(case["faults"]) for case in CASES]) == pytest.approx(1.5, abs=0.04)


def test_a_cascade_meets_no_fault_of_a_solver():
    assert "solver" not in reaching(named(ROWS, "cascade"))
    met = {f.kind for case in CASES if case["row"] == "cascade" for f in case_faults(case)}
    assert met == {kind.name for kind in KINDS if kind.place != "solver"}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_every_draw_of_a_kind_can_be_flown(kind):
    config = flight_config(named(ROWS, "nominal"), solver="sqp")
    for seed in range(20):
        duration, values = kind.draw(np.random.default_rng(seed))
        fault = Fault(kind.name, 3.0, duration, values)
        apply(config, [kind.make(fault, config)])


def test_without_a_fault_a_flight_is_what_it_was():
    config = flight_config(named(ROWS, "nominal"), solver="sqp")
    config.duration = 0.5
    plain, none = simulate(config, seed=1), simulate(config, seed=1, faults=NO_FAULTS)
    np.testing.assert_array_equal(plain["x_true"], none["x_true"])


@pytest.mark.parametrize("row", ["nominal", "cascade", "payload_filter"])
def test_a_long_burst_of_nan_raises_nothing_and_commands_numbers(row):
    result = faulty(row, "NaN burst", 0.6, sensor="all")
    assert not result["gave_up"]
    assert result["nan_commands"] == 0


def test_no_fault_of_sensors_or_solver_reaches_the_oracle():
    still = faulty("oracle", "late solves", 1.0, median=5.0, seed=1)
    frozen = faulty("oracle", "frozen sensor", 0.6, sensor="all")
    assert frozen == still
    assert still["fallbacks"] == 0


def test_the_oracle_knows_that_the_payload_is_gone():
    result = faulty("oracle", "cable cut")
    assert result["peak"] < 0.02  # as before; with the weight still in its model it rises by 5 cm [m]


def test_a_solver_that_fails_flies_its_plan():
    result = faulty("nominal", "failed solves", 0.2)
    assert result["fallbacks"] == 10
    assert result["lost_at"] is None


def signals(error):
    n = len(error)
    x = np.zeros((n, 13))
    x[:, 3], x[:, 0] = 1.0, error
    still = {"u": np.ones((n, 4)), "status": np.zeros((n, 1)), "p_ref": np.zeros((n, 3))}
    return {"t": 0.1 * np.arange(n), "x_true": x, **still}


def test_the_time_to_recover_ends_when_the_vehicle_is_back_for_good():
    error = np.zeros(50)
    error[[12, 20]] = 1.5 * BACK
    assert measures(signals(error), onset=1.0)["recovery"] == pytest.approx(1.0)  # [s]
    assert measures(signals(0 * error), onset=1.0)["recovery"] == 0.0
    error[-1] = 1.5 * BACK
    assert measures(signals(error), onset=1.0)["recovery"] is None


def test_a_vehicle_without_numbers_is_lost():
    error = np.zeros(50)
    error[30:] = np.nan
    assert measures(signals(error), onset=1.0)["lost_at"] == pytest.approx(3.0)  # [s]


def test_a_loss_is_physics_where_the_oracle_loses_the_same_draw():
    flights = [record("hold", 1, 4.0), record("np", 2, 4.0), record("oracle", 3, 4.0), record("gp", 4)]
    assert [case["seed"] for case in oracle_cases(flights)] == [1, 2]
    beside = [record("oracle", 1, 5.0), record("oracle", 2)]
    assert verdicts(flights, beside) == {1: PHYSICS, 2: OURS, 3: PHYSICS}
    assert verdicts(flights, [{"case": beside[0]["case"], "error": "none"}])[1] == OURS


def test_no_flight_counts_twice_and_one_without_result_is_an_exception():
    flights = [record("hold", 1, 4.0), record("hold", 2, recovery=1.5), record("hold", 3, recovery=None)]
    flights.append({"case": record("hold", 4)["case"], "error": "ValueError: no"})
    (line, total) = by_controller(flights, {1: OURS})
    assert {k: v for k, v in total.items() if k != "row"} == {k: v for k, v in line.items() if k != "row"}
    counts = [line[key] for key in ("flights", "exceptions", "lost", "ours", "physics", "away")]
    assert counts == [4, 1, 1, 1, 0, 1]
    assert (line["recovery"], line["recovery_90"]) == (1.5, None)


def test_the_figure_has_a_line_a_kind():
    figure = faults_figure(by_fault([record("hold", 1, 4.0), record("np", 2)], {1: OURS}))
    assert len(figure.axes[0].get_yticklabels()) == len(KIND)


def test_the_verb_flies_writes_and_resumes(tmp_path, capsys):
    arguments = ["reproduce", "faults", "--seed", "9600", "--flights", "2", "--jobs", "1", "--only", "hold"]
    arguments += ["--out", str(tmp_path), "--json", str(tmp_path / "x.json")]
    assert run(arguments) == 0
    first = json.loads((tmp_path / "x.json").read_text())
    assert (tmp_path / "faults.png").exists()
    assert first["table"][-1]["flights"] == 2
    assert first["table"][-1]["exceptions"] == first["table"][-1]["nan"] == 0
    assert max(len(line) for line in capsys.readouterr().out.splitlines() if "   " in line) <= 100
    assert run(arguments) == 0
    again = json.loads((tmp_path / "x.json").read_text())
    assert again["runs"] == first["runs"]  # processor times too: nothing flew again


@pytest.mark.parametrize("seed", [9605, 9611, 9612])  # lost before, with a payload of 3.5 kg in the forecast
def test_a_jerk_of_the_cable_does_not_make_the_payload_heavy(seed):
    faults = [dc.asdict(Fault("cable snap", 3.0, None, {"impulse": 0.35}))]
    result = Flying({}, "sqp")({"row": "payload_filter", "model": "", "faults": faults, "seed": seed})
    assert result["peak"] < 0.1  # the nominal MPC has 0.05 [m]


def test_a_vehicle_that_can_no_longer_fly_is_lost_and_raises_nothing():
    falling = [("lost rotor", {"rotor": 4.0, "efficiency": 0.0}), ("battery sag", {"scale": 0.7})]
    faults = [dc.asdict(Fault(kind, 3.0 + k, None, values)) for k, (kind, values) in enumerate(falling)]
    result = Flying({}, "sqp")({"row": "nominal", "model": "", "faults": faults, "seed": 9600})
    assert result["lost_at"] is not None
    assert result["nan_commands"] == 0
