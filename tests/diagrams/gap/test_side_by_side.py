"""Laws of the page on which a flight is seen beside both simulators."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.gap.side_by_side import LONGEST, RESTART, NoReplay, side_by_side, write_side_by_side
from diagrams.loop.flight import default_flight
from diagrams.loop.flight_result import fly
from diagrams.loop.replay import FRAME_RATE
from np_drake.diagnosis import result as an
from np_drake.effects import LinearDrag, SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.vehicle.vehicle import MeasurementNoise, Vehicle
from systems.payload_config import PayloadConfig
from tests.diagrams.gap.conftest import diagnosis

VEHICLE = Vehicle()
DRAG = LinearDrag(0.5, 0.5, 0.5)
NAME = "heldout"


def logged(**reality) -> FlightLog:
    """Flight of 4 s on a circle, with ideal sensors."""
    config = default_flight(VEHICLE)
    given = {"rotor_drag": 0.5, "motor_lag": 0.0, "thrust_scale": 1.0}
    given |= {"noise": MeasurementNoise(0, 0, 0, 0), "payload": PayloadConfig(tether="none")}
    config.reality = dc.replace(config.reality, **given | reality)
    config.duration, config.reference.ramp = 3.0, 1.0
    config.controller.kind, config.controller.solver = "hold", "sqp"
    return dc.replace(fly(config, seed=0).log(), name=NAME)


def found(*causes, joined=()) -> an.Diagnosis:
    return diagnosis(*causes, held_out=NAME, joined=joined)


def cause(effect, onset=None) -> an.Cause:
    return an.Cause(effect.identifier, 1.0, {}, {NAME: onset}, effect=effect)


@pytest.fixture(scope="module")
def log():
    return logged()


@pytest.fixture(scope="module")
def seen(log):
    return side_by_side(found(cause(DRAG)), VEHICLE, [log])


def test_the_ghost_of_a_perfect_simulator_lies_on_the_flight(seen):
    assert seen.corrected is not None
    assert seen.corrected.errors[:, 0].max() < 2e-3  # smoothing of the start [m]
    assert np.abs(seen.corrected.x[:, :3] - seen.x[:, :3]).max() < 2e-3
    assert seen.nominal.errors[:, 0].max() > 20 * seen.corrected.errors[:, 0].max()
    starts = np.flatnonzero(seen.restarted == np.arange(len(seen.x)))
    np.testing.assert_allclose(np.diff(starts) / FRAME_RATE, RESTART)
    assert np.all(seen.nominal.errors[starts, 0] == 0)  # both start anew from the flight


def test_a_cause_acts_from_its_onset_on(log):
    begins = side_by_side(found(cause(DRAG, onset=2.5)), VEHICLE, [log])
    before = begins.start + np.arange(len(begins.x)) / FRAME_RATE < 2.4
    corrected, nominal = begins.corrected.errors, begins.nominal.errors
    np.testing.assert_allclose(corrected[before], nominal[before], atol=1e-6)
    after = begins.restarted / FRAME_RATE + begins.start > 2.5
    assert corrected[after, 0].max() < 2e-3  # smoothing of the start [m]
    later = dc.replace(log, t=log.t + 100.0)  # an onset is on the clock of the log
    late = side_by_side(found(cause(DRAG, onset=102.5)), VEHICLE, [later])
    assert late.start == pytest.approx(begins.start)
    np.testing.assert_allclose(late.corrected.x, begins.corrected.x, atol=1e-6)


def test_of_a_flight_that_joined_the_fit_the_second_half_is_seen(log):
    half = side_by_side(found(cause(DRAG), joined=(NAME,)), VEHICLE, [log])
    assert half.start == pytest.approx(0.5 * log.t[-1], abs=0.03)


def test_the_page_shows_what_was_computed(seen, replay_page, tmp_path):
    write_side_by_side(seen, VEHICLE, tmp_path / "replay.html")
    page = replay_page(tmp_path / "replay.html")
    np.testing.assert_allclose(page.film["flight"]["position"], seen.x[:, :3], atol=1e-12)
    read = {error["label"]: error["cm"] for error in page.numbers["errors"]}
    for name in ("nominal", "corrected"):
        ghost = getattr(seen, name)
        np.testing.assert_allclose(page.film[name]["position"], ghost.x[:, :3], atol=1e-12)
        centimetres = 100 * ghost.errors[:, 0]
        np.testing.assert_allclose(read[f"{name} simulator"], centimetres, atol=0.00501)
    assert len(page.text) < 6e6 * len(seen.x) / (FRAME_RATE * LONGEST) + 2.5e6


def test_the_payload_of_a_cause_hangs_under_the_corrected_ghost(replay_page, tmp_path):
    payload = SuspendedPayload(0.2, 0.5, 0.0, 0.0, 0.0)
    flown = logged(payload=PayloadConfig(mass=0.2, length=0.5, hook=[0.0, 0.0, 0.0]))
    both = side_by_side(found(cause(DRAG), cause(payload)), VEHICLE, [flown])
    hanging = np.linalg.norm(both.corrected.p_WP - both.corrected.x[:, :3], axis=1)
    np.testing.assert_allclose(hanging, 0.5, rtol=0.01)
    assert np.isnan(both.nominal.p_WP).all()
    write_side_by_side(both, VEHICLE, tmp_path / "replay.html")
    page = replay_page(tmp_path / "replay.html")
    shown = page.film["corrected_payload"]["position"]
    np.testing.assert_allclose(shown, both.corrected.p_WP, atol=1e-12)
    assert "nominal_payload" not in page.objects


def test_a_lost_ghost_is_hidden_and_read_as_lost(seen, replay_page, tmp_path):
    x, errors = seen.nominal.x.copy(), seen.nominal.errors.copy()
    x[20:25], errors[20:25] = np.nan, np.inf
    lost = dc.replace(seen, corrected=None, nominal=dc.replace(seen.nominal, x=x, errors=errors))
    write_side_by_side(lost, VEHICLE, tmp_path / "replay.html")
    page = replay_page(tmp_path / "replay.html")
    assert page.numbers["errors"][0]["cm"][20:25] == [None] * 5
    np.testing.assert_array_equal(page.film["nominal"]["visible"], np.isfinite(errors[:, 0]))
    assert "corrected/body" not in page.objects


def test_a_flight_that_cannot_be_replayed_is_a_reason_in_one_line(log):
    torqueless = dc.replace(log, u=np.where(np.arange(4) > 0, np.nan, log.u))
    with pytest.raises(NoReplay, match="torque"):
        side_by_side(found(cause(DRAG)), VEHICLE, [torqueless])
    with pytest.raises(NoReplay, match="2 s"):
        side_by_side(found(cause(DRAG)), VEHICLE, [log.rows(0, 100)])
