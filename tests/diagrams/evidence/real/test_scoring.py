"""Laws of `np-drake reproduce real`: answers of any tool are scored against what is known."""

import dataclasses as dc
import json

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.evidence.challenge.out_of_library import OutOfLibraryWrench, periodic_force
from diagrams.evidence.real.campaigns import campaign_of
from diagrams.evidence.real.scoring import (
    BIC,
    LENGTHS,
    THIS,
    WRENCH,
    asked_figures,
    fit,
    ground_gains,
    library_columns,
    outcomes,
    payload_columns,
    scored,
    select_by_bic,
    verdict,
    wind_figures,
)
from diagrams.evidence.simulated_vehicles import Truth, fly_truth
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.blade_flapping import BladeFlapping
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.effects.translational_lift import TranslationalLift
from np_drake.logs.formats.log_file import write_log
from np_drake.vehicle import Vehicle, load_vehicle
from np_drake.vehicle.vehicle import ThrottleMap
from tests.np_drake.diagnosis.simulated_flights import fly

FORCE = {axis: {"rms": 2.0 + k, "after": 0.2 + 0.1 * k} for k, axis in enumerate("xy")}
CASES = ("01-02_to_11-12", "11-12_to_01-02")


def cause(effect, probability, absent_from=(), **more):
    return {"effect": effect, "probability": probability, "absent_from": list(absent_from), **more}


# One case


def test_names_are_judged_and_only_what_is_scored_must_be_there():
    said = {"causes": [cause("suspended_payload", 0.95), cause("constant_wind", 0.6)]}
    dut = scored(said, campaign_of("payload").truth)
    assert (dut["wrong"], dut["right"]) == (["constant_wind"], False)
    assert (dut["fraction"], dut["seconds"], dut["unknown"]) == (None, None, 0.0)


def test_since_flights_before_only_what_changed_counts():
    said = [{**cause("weak_rotor", 0.9), "changed": False}]
    said.append({**cause("suspended_payload", 0.95), "changed": True})
    dut = scored({"causes": said}, campaign_of("payload-since").truth)
    assert (dut["right"], list(dut["causes"])) == (True, ["suspended_payload"])


def test_a_wind_of_the_held_out_flight_alone_is_said_and_not_wrong():
    truth, new = campaign_of("new-wind").truth, cause("constant_wind", 0.9, ("a", "b"))
    drag = cause("linear_drag", 0.9, ("a", "b"))
    for said in ({"causes": [new]}, {"causes": [drag], "refit": {"causes": [new]}}):
        dut = scored(said, truth, {"a", "b"})
        assert (dut["new_condition"], dut["right"]) == ("constant_wind", True)
    assert scored({"causes": [new]}, truth, {"a", "c"})["wrong"] == ["constant_wind"]
    assert scored({"causes": [drag], "refit": None}, truth, {"a", "b"})["new_condition"] == ""


def test_the_unknown_counts_where_it_is_the_truth_and_where_a_place_pulls():
    said = {"causes": [], "unknown_probability": 0.8, "remains": [{"name": "place"}]}
    healthy, other = (campaign_of(g).truth for g in ("bare", "swarm-downwash-alone"))
    assert scored({**said, "remains": []}, other)["right"]
    assert not scored({"causes": []}, other)["right"]
    assert scored(said, healthy)["wrong"] == ["place"]
    assert scored({**said, "remains": []}, healthy)["right"]


def test_the_mean_force_of_a_wind_is_that_of_its_drag():
    log = fly(seed=5)
    # Drag in still air has a mean of its own, which is no wind's.
    log = dc.replace(log, v=log.v + [3.0, 0.0, 0.0])
    drag, wind, measured = (
        LinearDrag(0.5, 0.5, 0.5),
        ConstantWind(-4.0, 0.0),
        np.array([-2.0, 0, 0]),
    )
    dut = wind_figures([drag, wind], [log], Vehicle(), measured, 4.0)
    assert dut["force"] == pytest.approx(1.0, rel=0.05)  # rotor speed enters the drag
    assert (dut["angle"], dut["speed"]) == (pytest.approx(0.0), pytest.approx(1.0))
    aside = wind_figures([drag, ConstantWind(0.0, 4.0)], [log], Vehicle(), measured, 4.0)
    assert aside["angle"] == pytest.approx(90.0)
    assert wind_figures([wind], [log], Vehicle(), measured, 4.0)["force"] == 0.0
    assert wind_figures([drag], [log], Vehicle(), measured, 4.0) == {}


# The opponent: a planted effect is found, and BIC is sure of it

STEADY = {"force": np.array([-0.5, 0.2, 0.0]), "frequency": 0.0, "phase": np.pi / 2}


def found_on(log):
    e = make_flight_residuals(log, Vehicle())
    return select_by_bic(e.y[:, :WRENCH], library_columns([e]))


def test_a_steady_force_is_a_wind():
    found = found_on(fly(OutOfLibraryWrench(periodic_force, **STEADY), seed=2, noise=0.1))
    assert found.get("constant_wind", 0.0) > 0.99


def test_columns_of_noise_are_not_chosen_and_a_planted_one_is():
    draw = np.random.default_rng(0)
    y = draw.normal(size=(2000, 6))
    noise = [(f"noise_{i}", draw.normal(size=(2000, 6, 2))) for i in range(5)]
    assert select_by_bic(y, noise) == {}
    planted = ("planted", y[..., None] + draw.normal(size=(2000, 6, 1)))
    assert list(select_by_bic(y, [*noise, planted])) == ["planted"]


def test_the_criterion_is_that_of_gaussian_noise():
    draw = np.random.default_rng(1)
    X, noise = draw.normal(size=(500, 6, 2)), 0.1 * draw.normal(size=(500, 6))
    y = X @ [0.3, -0.2] + noise
    c, bic = fit(y, [("made", X)])
    assert c == pytest.approx([0.3, -0.2], abs=0.01)  # noise over root of 3000 rows
    left = np.mean((y - X @ c) ** 2, axis=0)
    assert bic == pytest.approx(500 * np.log(left).sum() + 2 * np.log(3000))


def test_a_planted_payload_is_found_at_its_length():
    mass, length = 0.15, LENGTHS[13]
    log = fly(
        SuspendedPayload(mass, length, 0.0, 0.0, 0.0, damping=0.1), seed=4, noise=0.1, vigour=0.5
    )
    assert found_on(log).get("suspended_payload", 0.0) > 0.99
    e = make_flight_residuals(log, Vehicle())
    y = e.y[:, :WRENCH] * [1, 1, 1, 0, 0, 0]
    fits = [fit(y, [columns]) for columns in payload_columns([e])]
    best = min(range(len(LENGTHS)), key=lambda i: fits[i][1])
    assert best == 13
    assert fits[best][0][0] == pytest.approx(mass, rel=0.06)  # linear about hanging still


# All cases


def record(group, causes, by=THIS, late=(), wind=None, **more):
    own = {**verdict(causes, campaign_of(group).truth, late), "fraction": 0.5, "unknown": 0.1}
    own |= {"seconds": 3.0, "new_condition": "", **more}
    return {"group": group, "case": "a", "methods": {by: own}, "wind": wind}


def estimate(value, half):
    return {"value": value, "ci95": [value - half, value + half]}


def payload(mass=0.0047, length=0.497, p=0.95, wrong=0.2):
    own = {"mass": estimate(mass, 0.0002), "length": estimate(length, 0.01)}
    causes = {"suspended_payload": p, "constant_wind": wrong}
    return record("payload", causes, parameters={"suspended_payload": own})


def asked(*records):
    return {line["asked"]: line for line in asked_figures(outcomes(records))}


def test_what_is_asked_counts_what_is_within_and_what_is_not():
    dut = asked(payload(), payload(mass=0.0040, p=0.5), payload(length=0.55, wrong=0.95))
    assert dut["payload: named"][THIS] == "2 of 3"
    assert dut["payload: mass within 10 %"][THIS] == "2 of 3"
    assert dut["payload: length within 5 %"][THIS] == "2 of 3"
    assert dut["payload: both in the 95 % interval"][THIS] == "1 of 3"
    assert dut["known cause: right"][THIS] == "1 of 3"
    assert dut["all: wrong names, p > 0.9"][THIS] == "1"
    assert dut["seconds a case, median"][THIS] == "3.0"


@pytest.mark.parametrize(
    "more, blown", [({}, 1), ({"mass_error": 0.9}, 0), ({"linear_drag": 0.4}, 0)]
)
def test_a_wind_is_asked_for_its_drag_direction_force_and_gentle_speed(more, blown):
    causes, wind = {"constant_wind": 0.9, "linear_drag": 0.9, **more}, {"angle": 12.0, "force": 0.9}
    strong = record("wind", causes, wind=12.1)
    gentle = record("wind", causes, wind=4.2)
    for own in (strong, gentle):
        own["methods"][THIS]["wind"] = {**wind, "speed": 1.2}
    dut = asked(strong, gentle)
    assert dut["wind: with drag, no mass or clock error"][THIS] == f"{2 * blown} of 2"
    assert dut["wind: direction within 10°"][THIS] == "0 of 2"
    assert dut["wind: mean force within 15 %"][THIS] == "2 of 2"
    assert dut["wind below 6 m/s: speed within 30 %"][THIS] == "1 of 1"


# The study


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Folder of real flights with two manoeuvres of a simulated vehicle that is healthy."""
    vehicle = load_vehicle("crazyflie_brushless")
    air = (LinearDrag(0.005, 0.005, 0.005), BladeFlapping(0.0), TranslationalLift(0.0))
    throttle = ThrottleMap(vehicle.max_rotor_thrust, 0.0, 0.0, 3.7, 1.5)
    truth = Truth(vehicle, throttle, np.zeros(3), *air, "rotor_speed", vehicle)
    root = tmp_path_factory.mktemp("real")
    (root / "imrc" / "bare").mkdir(parents=True)
    logs = fly_truth(truth, np.random.default_rng(4), 4, 6.0)
    for number, log in zip((1, 2, 11, 12), logs, strict=True):
        name = f"flight{number:02}"
        write_log(dc.replace(log, name=name), root / "imrc" / "bare" / f"{name}.csv")
    return root


def refused(capfd, *arguments) -> str:
    """Return the one line on stderr of a refused command."""
    assert run(["reproduce", "real", *map(str, arguments)]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text]
    return line


def test_bad_input_is_one_line(bare, capfd, tmp_path, monkeypatch):
    for name in ("NP_DRAKE_REAL", "NP_DRAKE_NEUROBEM"):
        monkeypatch.delenv(name, raising=False)
    assert "NP_DRAKE_REAL" in refused(capfd)
    assert "not there" in refused(capfd, tmp_path / "nowhere")
    assert "got none" in refused(capfd, tmp_path)
    assert "--only" in refused(capfd, tmp_path, "--only", "storm")
    assert "<group>/<case>/diagnosis.json" in refused(capfd, bare, "--answers", tmp_path)
    (tmp_path / "bare" / CASES[0]).mkdir(parents=True)
    (tmp_path / "bare" / CASES[0] / "diagnosis.json").write_text("{}")
    assert "causes is missing" in refused(capfd, bare, "--answers", tmp_path)
    (tmp_path / "imrc" / "bare").mkdir(parents=True)
    for number in (1, 2, 11):
        (tmp_path / "imrc" / "bare" / f"flight{number:02}").write_bytes(b"no log")
    assert "flight" in refused(capfd, tmp_path, "--out", tmp_path / "out")
    assert not list(tmp_path.glob("out/**/*.json"))


def test_what_the_diagnosis_says_is_scored_again_from_its_files(bare, tmp_path, monkeypatch):
    monkeypatch.delenv("NP_DRAKE_NEUROBEM", raising=False)
    out, first, again = tmp_path / "out", tmp_path / "first.json", tmp_path / "again.json"
    study = ["reproduce", "real", str(bare), "--only", "bare", "--jobs", "1"]
    assert run([*study, "--out", str(out), "--json", str(first)]) == 0
    assert run([*study, "--answers", str(out / "answers"), "--json", str(again)]) == 0
    before, after = (json.loads(file.read_text())["table"] for file in (first, again))
    assert before == after
    assert [list(row["methods"]) for row in before] == [[THIS, BIC]] * 2
    assert before[0]["vehicle"] == "imrc brushless"


def test_a_ground_effect_is_judged_by_the_thrust_that_it_gains():
    share = 0.06 / 1.06  # of which s / (1 - s) is 6 %
    radius = 4 * 0.085 * np.sqrt(share)
    gains = ground_gains({"value": radius, "ci95": [0.9 * radius, 1.1 * radius]})
    found = gains["gain_at_85_mm"]
    assert found["value"] == pytest.approx(0.06)
    assert found["ci95"][0] < 0.06 < found["ci95"][1]
    assert gains["gain_at_115_mm"]["value"] < 0.06
