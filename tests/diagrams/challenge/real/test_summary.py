"""Laws of what is asked: it counts the cases of a group by method, and tables keep within their
width.
"""

import pytest

from diagrams.challenge.real.campaigns import campaign_of
from diagrams.challenge.real.score import BIC, THIS, TOLD, verdict
from diagrams.challenge.real.summary import asked_figures, methods_of
from diagrams.challenge.real.tables import tables
from diagrams.cli.output import WIDTH, print_table


def estimate(value: float, half: float) -> dict:
    return {"value": value, "ci95": [value - half, value + half], "unit": ""}


def payload_record(
    mass: float = 0.0047, length: float = 0.497, p: float = 0.95, wrong: float = 0.2
) -> dict:
    own = {"suspended_payload": {"mass": estimate(mass, 0.0002), "length": estimate(length, 0.01)}}
    truth, cut = campaign_of("payload").truth, {"lateral": 0.9, "vertical": 0.8, "torque": None}
    causes = {"suspended_payload": p, "constant_wind": wrong}
    this = {
        **verdict(causes, truth),
        "parameters": own,
        "position": {"open": 0.09, "observed": 0.04},
    }
    this |= {"cut": cut, "fraction": 0.6, "unknown": 0.0, "seconds": 12.0, "new_condition": ""}
    bic = {**verdict({"suspended_payload": 1.0, "ground_effect": 1.0}, truth), "parameters": {}}
    told = {"causes": {}, "parameters": own}
    return {
        "group": "payload",
        "case": "06-10 -> 17-21",
        "methods": {THIS: this, BIC: bic, TOLD: told},
    }


def lines(records: list[dict]) -> dict[str, dict]:
    return {line["what"]: line for line in asked_figures(records)}


def said_of(group: str, case: str, causes: dict[str, float], by: str = THIS, **more) -> dict:
    """Return the record of a case with the answer of one method."""
    own = {
        "parameters": {},
        "cut": {},
        "fraction": 0.5,
        "unknown": 0.1,
        "seconds": 3.0,
        "new_condition": "",
        **more,
    }
    return {
        "group": group,
        "case": case,
        "methods": {by: {**verdict(causes, campaign_of(group).truth), **own}},
    }


def test_what_is_asked_counts_what_is_within_and_what_is_not():
    dut = lines(
        [
            payload_record(),
            payload_record(mass=0.0040, p=0.5),
            payload_record(length=0.55, wrong=0.95),
        ]
    )
    assert dut["payload: named"][THIS] == "2 of 3"
    assert dut["payload: mass within 10 %"][THIS] == "2 of 3"
    assert dut["payload: length within 5 %"][THIS] == "2 of 3"
    assert dut["payload: both in the 95 % interval"][THIS] == "1 of 3"
    assert dut["known cause: right"][THIS] == "1 of 3"
    assert dut["all: wrong names, p > 0.9"] == {
        "what": "all: wrong names, p > 0.9",
        "wanted": "0",
        THIS: "1",
        BIC: "3",
    }


def test_tables_keep_within_their_width(capsys):
    for table in tables([payload_record(), payload_record()]):
        print_table(*table)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) > 20
    assert max(map(len, printed)) <= WIDTH


def test_of_healthy_flights_false_names_and_all_beyond_drag_count():
    names = {"linear_drag": 1.0, "quadratic_drag": 0.9, "place": 0.4}
    records = [
        said_of("bare", "a", names),
        said_of(
            "idsia", "b", {**names, "weak_rotor": 0.9, "constant_wind": 0.8, "mixer_gain": 0.3}
        ),
        said_of("still", "c", {**names, "weak_rotor": 0.9}),
        said_of("swarm-downwash", "d", {"constant_wind": 1.0}),
    ]
    dut = lines(records)
    assert dut["healthy: cases with a false name"][THIS] == "1 of 3"
    assert dut["healthy: names beyond drag, median"][THIS] == "1"
    assert dut["healthy: names beyond drag, mean"][THIS] == "1.00"


def test_a_name_that_makes_the_held_out_flight_worse_counts():
    records = [
        said_of("bare", "a", {"linear_drag": 1.0}, fraction=-0.1),
        said_of("bare", "b", {"linear_drag": 0.4}, fraction=-0.1),
        said_of("bare", "c", {"linear_drag": 1.0}, fraction=None),
        said_of("bare", "d", {"linear_drag": 1.0}, fraction=0.3),
    ]
    assert lines(records)["all: named, and held out worse"][THIS] == "1 of 3"


@pytest.mark.parametrize(
    "over, right", [(1.0, "1 of 1"), (1.3, "1 of 1"), (1.5, "0 of 1"), (0.6, "0 of 1")]
)
def test_a_ground_effect_is_told_where_its_size_is_right(over, right):
    radius = campaign_of("swarm-ground-small").truth.parameters["effective_radius"].value
    own = {"ground_effect": {"effective_radius": estimate(over * radius, 0.001)}}
    records = [said_of("swarm-ground-small", "a", {"ground_effect": 0.9}, parameters=own)]
    assert lines(records)["ground effect: named, of the right size"][THIS] == right
    records = [said_of("swarm-ground-small", "a", {"ground_effect": 0.4}, parameters=own)]
    assert lines(records)["ground effect: named, of the right size"][THIS] == "0 of 1"


def test_answers_of_others_stand_between_the_diagnosis_and_the_baselines():
    records = [payload_record(), said_of("bare", "a", {}, by="previous")]
    assert methods_of(records) == [THIS, "previous", BIC, TOLD]
    assert methods_of(records, "naming") == [THIS, "previous", BIC]
    assert methods_of(records, "answering") == [THIS, "previous"]
    assert lines(records)["healthy: cases with a false name"] == {
        "what": "healthy: cases with a false name",
        "wanted": "≤ 5 %",
        "previous": "0 of 1",
    }
