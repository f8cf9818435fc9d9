"""Laws of the study of vehicles; the flights of the verb are made here."""

import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.batch.campaign import case_file
from diagrams.cli.main import run
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig
from diagrams.robustness.measures import lost_beyond, measures
from diagrams.robustness.vehicles import study
from diagrams.robustness.vehicles.fleet import TRACKS, VEHICLES, fleet
from diagrams.robustness.vehicles.study import (
    ROWS,
    campaign_config,
    flight_cases,
    flight_config,
    run_vehicles,
)
from diagrams.robustness.vehicles.table import vehicle_table
from diagrams.tracking import model_files, tracking
from np_drake.files.atomic_file import plain
from np_drake.vehicle.scaling import numbers, ratios

ROOT = Path(__file__).parents[4]
MODELS = {(v, row.configuration): v.encode() for v in VEHICLES for row in ROWS if row.configuration}


@pytest.mark.parametrize("vehicle", VEHICLES)
@pytest.mark.parametrize("track", TRACKS)
def test_every_track_can_be_flown_by_every_vehicle(vehicle, track):
    for row in ROWS:
        case = {"row": row.name, "vehicle": vehicle, "track": track}
        config = flight_config(case, solver="sqp", model="x" if row.configuration else "")
        assert config.vehicle == fleet()[vehicle]
        assert config.reference == load_experiment(track, fleet()[vehicle]).reference
        known = config.reality.payload.mass if row.known_mass else 0.0
        assert config.controller.extra_mass == known
        assert config.duration == 20.0 * ratios(fleet()[vehicle]).time


def test_the_fleet_weighs_what_its_names_say_and_can_lift_its_payload():
    assert [vehicle.mass for vehicle in fleet().values()] == [0.035, 2.0, 6.0]
    assert all(1.8 < numbers(vehicle).thrust_to_weight < 2.5 for vehicle in fleet().values())


def test_vehicles_are_made_when_they_are_asked_for_and_once():
    assert tuple(fleet()) == VEHICLES
    assert fleet() is fleet()


def test_every_vehicle_trains_on_60_s_of_its_own(monkeypatch):
    flown = []

    def fly(config: FlightConfig, **_):
        flown.append(config)

    monkeypatch.setattr(tracking, "fly", fly)
    for vehicle in fleet().values():
        tracking.training_flight("training_circle", seed=1, solver="sqp", vehicle=vehicle)
    assert [config.duration for config in flown] == [60.0] * 3
    assert [config.vehicle for config in flown] == list(fleet().values())
    assert flown[0].reference.radius == pytest.approx(0.256, abs=1e-3)  # [m]
    assert flown[0].reference.dither[0] == pytest.approx(0.08 * ratios(fleet()["35g"]).length)


def test_a_case_flies_with_the_model_of_its_own_vehicle():
    cases = flight_cases(ROWS, [1, 2], MODELS)
    assert len(cases) == len({case_file(case) for case in cases}) == 2 * 3 * 4 * len(ROWS)
    digests = {(case["vehicle"], case["model"]) for case in cases if case["row"] == "np"}
    assert len({digest for _, digest in digests}) == len(digests) == 3
    assert {case["model"] for case in cases if case["row"] == "oracle"} == {""}


def test_a_row_whose_training_failed_does_not_fly_with_that_vehicle():
    models = {key: file for key, file in MODELS.items() if key != ("35g", "payload_filter")}
    flown = {(case["vehicle"], case["row"]) for case in flight_cases(ROWS, [1], models)}
    assert ("35g", "payload_filter") not in flown
    assert {("35g", "np"), ("6kg", "payload_filter")} <= flown


def test_the_distance_at_which_a_vehicle_is_lost_scales_with_it():
    lost = {}
    for vehicle in ("35g", "paper"):
        config = flight_config(
            {"row": "nominal", "vehicle": vehicle, "track": "circle"}, solver="sqp"
        )
        assert lost_beyond(config) == ratios(fleet()[vehicle]).length
        n = 1250
        t, x = config.controller.period * np.arange(n), np.zeros((n, 13))
        x[:, 3], x[600:, 0] = 1.0, 0.3  # [m] off
        plant = np.zeros((n, 26))
        plant[:, 6] = 1.0
        u, zeros = np.tile(config.vehicle.hover_input, (n, 1)), np.zeros((n, 1))
        signals = {"t": t, "x_true": x, "p_ref": np.zeros((n, 3)), "u": u, "status": zeros}
        lost[vehicle] = measures(config, signals | {"plant_state": plant})["lost_at"]
    assert lost == {"35g": pytest.approx(6.0), "paper": None}


def test_work_trains_and_flies_with_the_vehicle_of_the_case(monkeypatch):
    seen = {}

    def train(rows, folder, **of):
        seen["trained"] = (*rows, of)
        (folder / "model").touch()
        return {"": str(folder / "model")}

    monkeypatch.setattr(model_files, "train_models", train)
    monkeypatch.setattr(
        study, "flown", lambda configure, model, seed: seen.setdefault("flown", (model, seed))
    )
    study.Training(7, "sqp", vehicles=fleet())({"vehicle": "6kg", "model": "payload_filter"})
    row, of = seen["trained"]
    assert (row.training, row.configuration) == ("training_circle", "payload_filter")
    assert (of["vehicle"], of["seed"]) == (fleet()["6kg"], 7)
    study.Flying(MODELS, "sqp")({"row": "np", "vehicle": "35g", "track": "steps", "seed": 3})
    assert seen["flown"] == (b"35g", 3)


@pytest.fixture
def made_flights(monkeypatch):
    """No flight: the oracle has 1 mm, every other controller 3 mm; hold is lost once with the 6 kg
    vehicle.
    """

    def runs(sweep, rows, vehicles, tracks):
        records, seeds = [], sweep.seeds
        for case in flight_cases(rows, seeds, MODELS, vehicles, tracks):
            lost = (case["row"], case["vehicle"], case["seed"]) == ("hold", "6kg", seeds[0])
            error = None if lost else 0.001 if case["row"] == "oracle" else 0.003
            result = dict.fromkeys(("E_xy", "E_z", "growth", "swing_growth"), error)
            result |= {"lost_at": 7.5 if lost else None, "solve_failures": 1, "at_limit": 0.1}
            records.append({"case": case, "result": result, "seconds": 6.0})
        return [], records

    monkeypatch.setattr(study, "run_vehicles", runs)


def test_ratios_are_to_the_oracle_of_the_same_vehicle_and_track(made_flights):
    _, records = study.run_vehicles(study.Sweep(0, count=2), ROWS, VEHICLES, TRACKS)
    lines = vehicle_table(records)
    assert len(lines) == 3 * 4 * len(ROWS)
    assert {line["E_xy_ratio"] for line in lines if line["row"] == "oracle"} == {1.0}
    assert {round(line["E_z_ratio"], 9) for line in lines if line["row"] == "np"} == {3.0}
    hold = [line for line in lines if (line["row"], line["vehicle"]) == ("hold", "6kg")]
    assert {(line["lost"], line["E_xy_ratio"]) for line in hold} == {(1, None)}
    without = [record for record in records if record["case"]["row"] != "oracle"]
    assert {line["E_xy_ratio"] for line in vehicle_table(without)} == {None}


def test_the_verb_prints_a_table_a_vehicle_within_100_columns(made_flights, tmp_path, capsys):
    files = ["--json", str(tmp_path / "m.json"), "--markdown", str(tmp_path / "m.md")]
    assert run(["reproduce", "vehicles", "--seed", "40", "--seeds", "2", *files]) == 0, (
        capsys.readouterr().err
    )
    said, page = capsys.readouterr().out, (tmp_path / "m.md").read_text()
    assert "| np | 0.300 ± 0.000 | 3.0 | 0.300 ± 0.000 | 3.0 | 0 of 2 |" in page
    assert page.count("| hold | – | – | – | – | 1 of 2 |") == len(TRACKS)
    assert max(map(len, page.splitlines())) <= 100
    assert "hold, 6kg, steps, seed 41: lost at 7.50 s" in said
    assert "144 flights, lost or failed: 4; failed solves: 144" in said
    content = json.loads((tmp_path / "m.json").read_text())
    assert (len(content["table"]), content["config"]["seeds"]) == (72, [41, 42])


def test_vehicles_and_tracks_that_are_named_are_flown_alone(made_flights, tmp_path, capsys):
    named = ["--vehicle", "35g", "--track", "steps", "--track", "circle", "--only", "nominal"]
    assert run(["reproduce", "vehicles", *named, "--json", str(tmp_path / "m.json")]) == 0
    lines = json.loads((tmp_path / "m.json").read_text())["table"]
    assert [(line["track"], line["row"]) for line in lines] == [
        (track, row) for track in ("circle", "steps") for row in ("nominal", "oracle")
    ]
    assert {line["vehicle"] for line in lines} == {"35g"}


def test_the_oracle_that_divides_the_others_flies_with_any_rows(made_flights, tmp_path):
    named = ["--vehicle", "35g", "--track", "steps", "--only", "hold"]
    assert run(["reproduce", "vehicles", *named, "--json", str(tmp_path / "m.json")]) == 0
    lines = json.loads((tmp_path / "m.json").read_text())["table"]
    ratios = {line["row"]: line["E_xy_ratio"] for line in lines}
    assert ratios == {"nominal": pytest.approx(3.0), "hold": pytest.approx(3.0), "oracle": 1.0}


@pytest.mark.parametrize(
    ("option", "known"), [("--vehicle", "35g, paper, 6kg"), ("--track", ", ".join(TRACKS))]
)
def test_an_unknown_name_is_one_line(option, known, capsys):
    assert run(["reproduce", "vehicles", option, "spiral"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == f"np-drake reproduce vehicles: {option}: must be one of {known}; got spiral."


def test_a_campaign_goes_on_with_fewer_vehicles_and_tracks(tmp_path, monkeypatch):
    calls = []

    def campaign(work, cases, *, config, **_):
        calls.append((cases, config))
        return [{"case": case, "result": {}, "seconds": 0.0} for case in cases]

    monkeypatch.setattr("diagrams.batch.workers.run_campaign", campaign)
    for vehicles, tracks in ((["35g"], ["steps"]), ([*VEHICLES], TRACKS)):
        run_vehicles(study.Sweep(1, count=1), ROWS[:1], vehicles, tracks)
    (few, first), (many, second) = calls
    assert first == second
    assert len(few) == 1
    assert few[0] in many
    assert set(first["vehicles"]) == set(VEHICLES)


def changed(config: FlightConfig, field: str) -> FlightConfig:
    """The settings with the one at a dotted path half as large again, or another."""
    at, (*path, last) = config, field.split(".")
    for name in path:
        at = getattr(at, name)
    value = getattr(at, last)
    setattr(at, last, not value if isinstance(value, bool) else 1.5 * value)
    return config


@pytest.mark.parametrize(
    "field",
    [
        "duration",
        "simulator.max_step_size",
        "simulator.accuracy",
        "controller.period",
        "controller.label.force_bandwidth",
        "controller.track_delay",
        "reality.payload.mass",
        "reference.speed",
    ],
)
@pytest.mark.parametrize("of", ["flight_config", "training_config"])
def test_a_changed_setting_of_flight_or_training_is_another_campaign(monkeypatch, of, field):
    before = campaign_config(1, "sqp")
    assert before == campaign_config(1, "sqp")
    made = getattr(study, of)
    monkeypatch.setattr(study, of, lambda *args, **kwargs: changed(made(*args, **kwargs), field))
    assert campaign_config(1, "sqp") != before


@pytest.mark.parametrize("track", TRACKS)
def test_a_changed_setting_of_one_track_is_another_campaign(monkeypatch, track):
    before, made = campaign_config(1, "sqp"), study.flight_config

    def one_changed(case, **kwargs):
        config = made(case, **kwargs)
        return changed(config, "reference.ramp") if case["track"] == track else config

    monkeypatch.setattr(study, "flight_config", one_changed)
    assert campaign_config(1, "sqp") != before


def test_what_a_campaign_depends_on_fits_in_every_file_of_a_case():
    text = json.dumps(plain(campaign_config(1, "sqp")), allow_nan=False)
    assert len(text) < 40_000  # [B], beside hundreds of cases
    assert json.loads(text)["rows"]["np"]["configuration"] == "neural"
