"""Laws of what neither noise nor sensors do: when it matters."""

import numpy as np
import pytest

from np_drake.diagnosis.decision import unexplained as dut
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


@pytest.mark.parametrize("force", [0.005, 0.05], ids=["too small to matter", "large"])
def test_a_burst_is_asked_whether_it_matters(ranked, force):
    """Of weight, in logs that have next to no noise."""
    case = ranked()
    weight = case.flights[0].vehicle.mass * 9.81
    residual = {e.name: 1e-4 * weight * np.sin(e.t)[:, None] * np.ones(15) for e in case.flights}
    residual[case.flights[0].name][200:260, 2] += force * weight
    burst, found, *_ = dut._burst_test(case.flights, residual, REAL)
    assert found.size > 2 * REAL.thresholds.burst_ratio
    assert (burst > 0.5) is (force > 0.01)


@pytest.mark.parametrize(
    "again, unknown", [(1.0, True), (0.3, False)], ids=["there too", "not there"]
)
def test_a_slow_torque_is_asked_of_unseen_flights_as_well(ranked, monkeypatch, again, unknown):
    flights, options = ranked().flights, REAL
    limit = REAL.thresholds.slow_torque_ratio
    monkeypatch.setattr(
        dut, "slow_torque", lambda some, _: ((2.0 if some else again) * limit, 1.0, 1.0, 0)
    )
    found, *_ = dut._slow_torque_test(
        flights, [], {e.name: e.y for e in flights}, options, hidden=False
    )
    assert (found > 0.5) is unknown


def test_a_line_matters_less_on_a_rig(ranked):
    flights = ranked().flights
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    rig, laboratory = (dut._least_lines(flights, t.materiality) for t in (REAL, IDEAL))
    assert rig[0] == pytest.approx(0.006 * weight)
    assert np.all(laboratory[:3] == pytest.approx(0.5 * rig[:3]))


@pytest.mark.parametrize("share, hidden", [(0.01, False), (0.9, True), (0.1, True)])
@pytest.mark.parametrize("size", [0.5, 2.0])
def test_a_slow_torque_is_unknown_where_it_is_material_and_no_lost_swing(
    ranked, monkeypatch, share, hidden, size
):
    """size: of the torque, over what matters."""
    flights, limit = ranked().flights, REAL.thresholds.slow_torque_ratio
    torque = (2 * limit, share, size * dut._least_structure(flights, REAL.materiality)[1], 0)
    monkeypatch.setattr(dut, "slow_torque", lambda *_: torque)
    found, *_ = dut._slow_torque_test(
        flights, flights, {e.name: e.y for e in flights}, REAL, hidden=hidden
    )
    assert (found > 0.5) is (size > 1 and (share > 0.5 or not hidden))
