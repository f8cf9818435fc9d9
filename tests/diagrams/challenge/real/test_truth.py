"""Laws of the truth: what is known to be there or not is judged, the rest is neither right nor
wrong.
"""

import math

import numpy as np
import pytest

from diagrams.challenge.real.campaigns import CAMPAIGNS, GROUPS, campaign_of
from diagrams.challenge.real.truth import DRAG, GROUND, PLACE, Known, named, near_ground
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.base import Motion
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.library import BESIDE_NEIGHBOURS, LIBRARY
from np_drake.vehicle import load_vehicle

HEALTHY = [c.group for c in CAMPAIGNS if c.truth.healthy]


def test_every_campaign_has_a_truth_with_source_and_names_of_the_library():
    assert len(set(GROUPS)) == len(GROUPS)
    for campaign in CAMPAIGNS:
        truth = campaign.truth
        assert truth.source
        assert {*truth.present, DRAG, *truth.false} <= {*LIBRARY, *BESIDE_NEIGHBOURS, UNKNOWN}
        assert not {*truth.present, DRAG} & set(truth.false)
        assert not (truth.healthy and truth.present)


def test_a_cause_counts_above_one_half_only():
    assert named({"linear_drag": 0.5, "mass_error": 0.51}) == ["mass_error"]


@pytest.mark.parametrize("group", [c.group for c in CAMPAIGNS if c.truth.present])
def test_without_its_known_cause_an_answer_is_not_right(group):
    truth = campaign_of(group).truth
    assert not truth.right({})
    assert not truth.right({truth.present[0]: 0.2})
    assert truth.right({truth.present[0]: 0.6, "linear_drag": 0.9, "thrust_scale": 0.9})


@pytest.mark.parametrize("group", GROUPS)
def test_a_false_name_makes_an_answer_wrong_and_a_silent_one_does_not(group):
    truth = campaign_of(group).truth
    known = {truth.present[0]: 0.9} if truth.present else {}
    assert truth.right(known)
    for name in truth.false:
        assert truth.wrong({**known, name: 0.6}) == [name]
        assert not truth.right({**known, name: 0.6})
        assert truth.right({**known, name: 0.4})


@pytest.mark.parametrize("group", HEALTHY)
def test_on_a_healthy_flight_nothing_begins_and_no_place_pulls(group):
    truth = campaign_of(group).truth
    assert truth.wrong({DRAG: 0.9, "thrust_scale": 0.9}, ["thrust_scale"]) == ["thrust_scale"]
    assert truth.wrong({DRAG: 0.9}, [DRAG]) == [DRAG]
    assert truth.wrong({PLACE: 0.9}) == [PLACE]
    assert not campaign_of("payload").truth.wrong({"thrust_scale": 0.9}, ["thrust_scale"])


def test_what_is_not_known_is_not_judged():
    causes = {"suspended_payload": 0.8, "linear_drag": 0.7, "mixer_gain": 0.9, "constant_wind": 0.3}
    assert campaign_of("bare").truth.judged(causes) == [(0.8, False), (0.7, True), (0.3, False)]


def test_a_parameter_is_in_its_range_or_not_told():
    known = Known.within(0.005, 0.1)
    assert known.holds(0.0054)
    assert not known.holds(0.0056)
    assert not known.holds(None)


def test_the_asked_radii_halve_and_double_the_ground_effect():
    vehicle = load_vehicle("crazyflie")
    known = near_ground("here", vehicle).parameters["effective_radius"]
    assert known.value == 2 * vehicle.rotor_radius  # four rotors have the area of one twice as wide

    def thrust(radius: float) -> float:
        x = np.zeros(13)
        x[2], x[3] = 2 * known.value, 1.0
        motion = Motion(np.zeros(1), x[None], np.full((1, 4), 0.1))
        return float(GroundEffect(radius).wrench(vehicle, motion)[0, 2])

    assert thrust(known.low) / thrust(known.value) == pytest.approx(
        0.5, rel=0.02
    )  # 1 / (1 - s), s up to 3 %
    assert thrust(known.high) / thrust(known.value) == pytest.approx(2.0, rel=0.02)
    assert math.isclose(known.low * known.high, known.value**2)
    assert GROUND in near_ground("here", vehicle).present


def test_a_vehicle_weighs_what_its_campaign_states_without_the_payload():
    assert campaign_of("crazyswarm2-payload").nominal.mass == pytest.approx(0.0419 - 0.005)
    assert campaign_of("payload").nominal.mass == pytest.approx(0.0397)
    assert (campaign_of("swarm-ground-large").nominal.thrust_uncertainty or 0) > 0.3  # a guess
