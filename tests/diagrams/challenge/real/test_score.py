"""Laws of the score: an answer is read as it was given, held-out figures and hints are those of the
file.
"""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.real.campaigns import campaign_of
from diagrams.challenge.real.cases import make_cases
from diagrams.challenge.real.flights import open_case
from diagrams.challenge.real.score import (
    Scoring,
    angle,
    held_out_cut,
    says_new_condition,
    scored,
    wind_figures,
)
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.vehicle import Vehicle

FORCE = {
    "x": {"rms": 3.0, "after": 0.3},
    "y": {"rms": 4.0, "after": 0.4},
    "z": {"rms": 2.0, "after": 1.0},
}
NO_TORQUE = {axis: {"rms": 0.0, "after": 0.0} for axis in "xyz"}


def cause(
    effect: str, probability: float, absent_from: tuple[str, ...] = (), **values: float
) -> dict:
    parameters = {
        k: {"value": v, "unit": "", "ci95": [0.9 * v, 1.1 * v]} for k, v in values.items()
    }
    return {
        "effect": effect,
        "probability": probability,
        "parameters": parameters,
        "absent_from": list(absent_from),
    }


def answer(*causes: dict, **more) -> dict:
    return {
        "causes": list(causes),
        "gap": {"force": FORCE, "torque": NO_TORQUE},
        "wall": 3.0,
        **more,
    }


def test_held_out_figures_are_of_the_norm_and_absent_for_unknown_torque():
    cut = held_out_cut({"force": FORCE, "torque": NO_TORQUE})
    assert cut == {"lateral": pytest.approx(0.9), "vertical": pytest.approx(0.5), "torque": None}
    assert held_out_cut({}) == {"lateral": None, "vertical": None, "torque": None}


def test_names_are_judged_against_the_truth_of_their_flights():
    dut = scored(
        answer(cause("suspended_payload", 0.95, mass=0.0047), cause("constant_wind", 0.6)),
        campaign_of("payload").truth,
    )
    assert dut["wrong"] == ["constant_wind"]
    assert not dut["right"]
    assert dut["parameters"]["suspended_payload"]["mass"]["value"] == 0.0047


def test_a_wind_of_the_held_out_flight_alone_is_not_wrong():
    @dc.dataclass
    class Log:
        name: str

    said = answer(cause("constant_wind", 0.9, absent_from=("a", "b")))
    dut = scored(said, campaign_of("new-wind").truth, [Log("a"), Log("b")])  # type: ignore[list-item]
    assert dut["new_condition"]
    assert dut["right"]
    assert not scored(said, campaign_of("new-wind").truth, [Log("a"), Log("c")])["right"]  # type: ignore[list-item]


def test_a_wind_of_the_second_answer_alone_counts_as_said():
    first = answer()
    second = answer(cause("constant_wind", 0.9, absent_from=("a", "b")))
    assert says_new_condition({**first, "refit": second}, {"a", "b"}) == "constant_wind"
    assert says_new_condition({**first, "refit": second}, {"a", "c"}) == ""
    assert says_new_condition({**first, "refit": None}, {"a", "b"}) == ""
    assert (
        says_new_condition(answer(cause("linear_drag", 0.9, absent_from=("a", "b"))), {"a", "b"})
        == ""
    )


def test_angles_are_between_directions():
    assert angle(np.array([-2.0, 0.0]), np.array([-1.0, 0.0])) == pytest.approx(0.0)
    assert angle(np.array([0.0, 1.0]), np.array([-1.0, 0.0])) == pytest.approx(90.0)


def test_the_mean_force_of_a_told_wind_is_that_of_its_drag(make_flight):
    vehicle = Vehicle()
    log = make_flight(5, lambda t, p, v, a: 0 * v)
    log = dc.replace(
        log, v=log.v + [3.0, 0.0, 0.0]
    )  # drag in still air has a mean of its own, which is no wind's
    drag, wind = LinearDrag(0.5, 0.5, 0.5), ConstantWind(-4.0, 0.0, 0.0)
    measured = np.array([-2.0, 0.0, 0.0])
    dut = wind_figures([drag, wind], [log], vehicle, measured, 4.0)
    assert dut["force"] == pytest.approx(1.0, rel=0.05)  # rotor speed enters the drag
    assert (dut["angle"], dut["speed"]) == (pytest.approx(0.0), pytest.approx(1.0))
    assert wind_figures([wind], [log], vehicle, measured, 4.0)["force"] == 0.0
    assert wind_figures([drag], [log], vehicle, measured, 4.0) == {}


def test_a_real_bare_flight_is_scored(real_flights):
    case = next(
        case for case in make_cases(real_flights, only=["bare"]) if case.name.startswith("22-26 ->")
    )
    vehicle, train, held_out = open_case(case)
    direct = diagnose(vehicle, train, held_out, adaptive_split=False)
    methods = Scoring()(case)["methods"]
    assert list(methods) == ["this", "BIC"]
    assert methods["this"]["causes"] == {c.identifier: c.probability for c in direct.causes}
    assert methods["this"]["cut"]["lateral"] > 0
    assert methods["this"]["seconds"] > 0


def test_only_what_is_scored_of_an_answer_must_be_there():
    said = {"causes": [{"effect": "linear_drag", "probability": 0.9}]}
    dut = scored(said, campaign_of("bare").truth)
    assert dut["right"]
    assert (dut["fraction"], dut["seconds"], dut["unknown"]) == (None, None, 0.0)
    assert dut["cut"] == {"lateral": None, "vertical": None, "torque": None}


def test_a_cause_that_begins_in_a_healthy_flight_is_wrong():
    early = {
        "effect": "thrust_scale",
        "probability": 0.9,
        "onset": {"a": None, "b": None},
        "absent_from": ["b"],
    }
    late = {**early, "onset": {"a": None, "b": 3.2}}
    assert scored({"causes": [early]}, campaign_of("bare").truth)["right"]
    assert scored({"causes": [late]}, campaign_of("bare").truth)["wrong"] == ["thrust_scale"]
    assert scored({"causes": [late]}, campaign_of("swarm-downwash-alone").truth)["wrong"] == []


def test_the_unknown_counts_where_it_is_the_truth_and_where_a_place_pulls():
    said = {"causes": [], "unknown_probability": 0.8, "remains": [{"name": "place"}]}
    assert scored(
        {"causes": [], "unknown_probability": 0.8}, campaign_of("swarm-downwash-alone").truth
    )["right"]
    assert not scored({"causes": []}, campaign_of("swarm-downwash-alone").truth)["right"]
    assert scored(said, campaign_of("bare").truth)["wrong"] == ["place"]
    assert scored({**said, "remains": []}, campaign_of("bare").truth)["right"]
