"""Laws of the cooperative example."""

import numpy as np
import pytest

from diagrams.payload.cooperative import CORNERS, fly, make_cooperative_diagram
from np_drake.references.payload import closest_approach

SETTLED = 100  # rows: 2 s


@pytest.fixture(scope="module")
def flown():
    return {kind: fly(kind, end=4.0) for kind in ("nominal", "payload_filter")}


def positions(rows):
    return np.stack([rows[f"x_{i}"][:, :3] for i in range(len(CORNERS))])


def test_a_pilot_reads_its_own_vehicle_alone():
    diagram, _ = make_cooperative_diagram("nominal")
    for i in range(len(CORNERS)):
        pilot = diagram.GetSubsystemByName(f"pilot_{i}")
        assert pilot.num_input_ports() == 3


def test_vehicles_stay_apart(flown):
    assert closest_approach(positions(flown["payload_filter"])) > 0.8  # [m]; the formation has 0.9


def test_a_model_of_the_payload_carries_what_the_nominal_model_lacks(flown):
    sag = {
        kind: np.abs(positions(rows)[:, SETTLED:, 2] - 2.0).mean() for kind, rows in flown.items()
    }  # [m] below the height of the formation
    assert sag["payload_filter"] < 0.3 * sag["nominal"]
