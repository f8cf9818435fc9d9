"""Laws of what neither noise nor sensors do: when it matters."""

import numpy as np
import pytest

from np_drake.diagnosis.adequacy import residual_tests as dut
from np_drake.diagnosis.options import Options

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


def test_on_a_rig_an_accelerometer_may_read_another_weight_in_every_flight(ranked):
    case = ranked()
    residual = {e.name: np.zeros_like(e.y) for e in case.flights}
    residual[case.flights[0].name][:, 2] = 0.01 * case.flights[0].vehicle.mass * 9.81
    irregularities = {t.tolerance.name: dut.irregularities(case.flights, residual, t) for t in (REAL, IDEAL)}
    assert [p > 0.5 for p, _ in irregularities["rig"]] == [False, False]
    assert [p > 0.5 for p, _ in irregularities["laboratory"]] == [False, True]


@pytest.mark.parametrize("force", [0.005, 0.05], ids=["too small to matter", "large"])
def test_a_burst_is_asked_whether_it_matters(ranked, force):
    """Of weight, in logs that have next to no noise."""
    case = ranked()
    weight = case.flights[0].vehicle.mass * 9.81
    residual = {e.name: 1e-4 * weight * np.sin(e.t)[:, None] * np.ones(15) for e in case.flights}
    residual[case.flights[0].name][200:260, 2] += force * weight
    (burst, found), _ = dut.irregularities(case.flights, residual, REAL)
    assert found.size > 2 * REAL.thresholds.burst
    assert (burst > 0.5) is (force > 0.01)


@pytest.mark.parametrize("times, unknown", [(1.7, False), (2.3, True)])
def test_a_slow_force_of_unseen_flights_alone_is_more_than_an_attitude_that_wanders(
    ranked, monkeypatch, times, unknown
):
    case, rig = ranked(), REAL
    weight = case.held_out[0].vehicle.mass * case.held_out[0].vehicle.gravity
    monkeypatch.setattr(dut, "slow_power", lambda *_: (times * weight * rig.tolerance.attitude) ** 2)
    residual = {e.name: e.y for e in case.held_out}
    assert (dut.novel_on_held_out(case.held_out, residual, rig, 0.0)[0] > 0.5) is unknown


def test_a_line_matters_less_on_a_rig(ranked):
    flights = ranked().flights
    weight = flights[0].vehicle.mass * flights[0].vehicle.gravity
    rig, laboratory = (dut.least_lines(flights, t.materiality) for t in (REAL, IDEAL))
    assert rig[0] == pytest.approx(0.005 * weight)
    assert np.all(laboratory[:3] == pytest.approx(0.3 * rig[:3]))


@pytest.mark.parametrize(
    "times, share, size, unknown",
    [
        (1.5, 0.01, 9.0, False),
        (1.5, 0.05, 0.1, True),
        (8.0, 0.01, 9.0, True),
        (8.0, 0.01, 0.1, False),
        (0.5, 0.9, 9.0, False),
    ],
    ids=["a small share", "a large one", "small but far from any noise", "in logs without noise", "noise"],
)
def test_a_slow_torque_matters_by_its_share_or_far_above_what_noise_has(
    ranked, monkeypatch, times, share, size, unknown
):
    """size: of the torque, over what matters."""
    flights, options = ranked().flights, REAL
    torque = (
        times * REAL.thresholds.slow_torque,
        share,
        size * dut.least_structure(flights, options.materiality)[1],
    )
    monkeypatch.setattr(dut, "slow_torque", lambda *_: torque)
    found, _ = dut.slow_torque_test(torque, flights, flights, {}, options, hidden=False)
    assert (found > 0.5) is unknown


@pytest.mark.parametrize("again, unknown", [(1.0, True), (0.3, False)], ids=["there too", "not there"])
def test_a_slow_torque_is_asked_of_unseen_flights_as_well(ranked, monkeypatch, again, unknown):
    flights, options = ranked().flights, REAL
    limit = REAL.thresholds.slow_torque
    monkeypatch.setattr(dut, "slow_torque", lambda *_: (again * limit, 1.0, 1.0))
    found, _ = dut.slow_torque_test((2 * limit, 1.0, 1.0), flights, flights, {}, options, hidden=False)
    assert (found > 0.5) is unknown
