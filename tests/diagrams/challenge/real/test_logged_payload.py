"""Laws of the logged payload: it hangs where its documents say, in either form of the log."""

import numpy as np
import pytest

from diagrams.challenge.real.campaigns import campaign_of
from diagrams.challenge.real.flights import open_flights
from diagrams.challenge.real.logged_payload import logged_payload
from np_drake.logs.errors import LogError


@pytest.mark.parametrize("group", ["payload", "crazyswarm2-payload"])
def test_a_real_payload_hangs_a_string_below_its_vehicle(real_flights, group):
    campaign = campaign_of(group)
    path, *_ = campaign.files(real_flights)
    (flight,) = open_flights(path, campaign)
    t, p = logged_payload(path, flight)
    inside = (t >= flight.t[0]) & (t <= flight.t[-1])
    p_WB = np.stack([np.interp(t[inside], flight.t, flight.p[:, i]) for i in range(3)], axis=1)
    distance = np.median(np.linalg.norm(p[inside] - p_WB, axis=1))
    assert distance == pytest.approx(
        campaign.truth.parameters["length"].value, rel=0.05
    )  # of string and pendulum


def test_a_real_log_without_a_payload_is_said(real_flights):
    campaign = campaign_of("crazyswarm2-upgraded")
    path, *_ = campaign.files(real_flights)
    with pytest.raises(LogError, match="no position of a payload"):
        logged_payload(path, open_flights(path, campaign)[0])
