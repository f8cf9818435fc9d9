"""Laws of the forecasts on real flights with a payload."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.cli.main import run
from diagrams.evidence.real import payload_flights as forecast
from diagrams.evidence.real.payload_flights import (
    GROUPS,
    HISTORY,
    HORIZONS,
    PERSISTENCE,
    STEP,
    _segments,
    fit_ridge,
    held_out_errors,
    pooled,
    sampled_flight,
    square_errors,
)
from np_drake.effects.linear_drag import LinearDrag
from np_drake.flight_log import FlightLog
from np_drake.residual_model import Sample
from np_drake.residual_models.hold import Constant, Hold
from np_drake.training_data.segments import Segment
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis.simulated_flights import fly

VEHICLE = Vehicle()


@pytest.fixture(scope="module")
def manoeuvres():
    """Three manoeuvres of two flights each, with drag."""
    drag = LinearDrag(0.3, 0.3, 0.3)
    flights = [fly(drag, name=f"made_{k}", seed=k, seconds=4.0) for k in range(6)]
    return {f"{k}": [(log, VEHICLE) for log in flights[2 * k : 2 * k + 2]] for k in range(3)}


def test_a_ratio_is_that_of_the_pooled_errors():
    def own(*squares):
        one = {"count": [4] * len(HORIZONS)}
        shape = (3, len(HORIZONS))
        return {n: {**one, "square": np.full(shape, s)} for n, s in zip("ab", squares, strict=True)}

    lines = pooled({(PERSISTENCE, "known"): own(4.0, 12.0), ("mine", "known"): own(4.0, 5.0)})
    line = next(x for x in lines if (x["row"], x["kind"]) == ("mine", "force"))
    assert line["ratio"] == pytest.approx(np.sqrt(9 / 16))
    assert line["rmse"] == pytest.approx(np.sqrt(9 / 8))
    assert line["horizon"] == STEP * HORIZONS[0]
    assert line["interval"] == pytest.approx([np.sqrt(5 / 12), 1.0])  # only b is drawn, or only a


def test_the_error_is_that_against_the_averaged_label(manoeuvres):
    opened = manoeuvres["0"][0]
    flight, mean = sampled_flight(*opened), np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    found = square_errors(Constant(mean, step=STEP, name="mean"), opened, "known")
    first = HISTORY + HORIZONS[2]
    error = (flight.chi[first:] - mean) ** 2
    assert found["count"][2] == len(flight) - first
    assert found["square"][0][2] == pytest.approx(error[:, :2].sum())
    assert found["square"][1][2] == pytest.approx(error[:, :3].sum())


RATE = np.array([1.0, -2.0, 3.0])  # N/s


def ramp(step=0.002, seconds=1.0):
    """A level vehicle that is pushed by a force which grows with time."""
    t = step * np.arange(round(seconds / step) + 1) + 7.0
    force = RATE * (t - 7.0)[:, None]
    n, zero = len(t), np.zeros((len(t), 3))
    q, u = np.tile([1.0, 0, 0, 0], (n, 1)), np.tile(VEHICLE.hover_input, (n, 1))
    v = np.stack([t - 7.0, 0 * t, 0 * t], axis=1)
    return FlightLog(t, zero, q, v, zero, u, force / VEHICLE.mass, zero)


def test_a_label_is_the_mean_over_the_step_that_ends_at_its_sample():
    flight = sampled_flight(ramp(), VEHICLE)
    k = np.arange(1, len(flight))
    # Ten rows of a step, from 18 ms before its end to the end: 9 ms before the sample in the mean.
    np.testing.assert_allclose(flight.chi[1:, :3], np.outer(0.02 * k - 0.009, RATE), atol=1e-9)
    np.testing.assert_allclose(flight.x[:, 7], 0.02 * np.arange(len(flight)), atol=1e-9)
    assert len(flight) == 51


def test_a_gap_has_no_label_keeps_the_command_and_is_bridged_for_training():
    log = ramp()
    gone = (log.t > 7.4 + 1e-6) & (log.t < 7.44 + 1e-6)
    cut = dc.replace(
        log, **{n: getattr(log, n)[~gone] for n in ("t", "p", "q", "v", "w", "u", "a", "al")}
    )
    flight = sampled_flight(cut, VEHICLE)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(flight.chi).any(axis=1)), [21, 22])
    np.testing.assert_array_equal(flight.u[[21, 22]], flight.u[[20, 20]])
    np.testing.assert_allclose(flight.x[[21, 22], 7], 0.4, atol=1e-9)
    bridged, whole = _segments([(cut, VEHICLE), (log, VEHICLE)])
    np.testing.assert_allclose(bridged.chi, whole.chi, atol=1e-9)
    with pytest.raises(ValueError, match="must have a row every"):
        sampled_flight(ramp(seconds=0.5), VEHICLE)


UNITS = 10.0 ** np.linspace(-3, 3, 12)


def swinging(seed, n=300):
    """Every channel a level and two oscillations, with phases and sizes of its own."""
    draw, t = np.random.default_rng(seed), STEP * np.arange(n)
    phases, sizes = draw.uniform(0, 2 * np.pi, (2, 12, 1)), draw.uniform(0.5, 1.5, (2, 12, 1))
    samples = sizes[0] * np.sin(4.4 * t + phases[0]) + sizes[1] * np.sin(9.0 * t + phases[1]) + 0.3
    return Segment(*np.split(UNITS * samples.T, 2, axis=1), STEP)


def test_the_ridge_forecasts_an_oscillation_by_groups_of_channels():
    dut, unseen = fit_ridge([swinging(seed) for seed in range(8)]), swinging(99)
    memory = dut.initial_memory()
    for chi in (np.ones(6), np.full(6, np.nan)):  # held until the window is full
        memory = dut.update(memory, Sample(np.zeros(13), np.zeros(4), chi))
    assert np.all(dut.forecast(memory, horizon=3, stride=1).offset == 1.0)
    window = np.hstack([unseen.chi, unseen.zeta])[70:100]
    memory = {"window": window, "count": np.array([30.0])}
    before = dut.forecast(memory, horizon=51, stride=1).offset[list(HORIZONS)]
    truth = unseen.chi[99 + np.array(HORIZONS)]
    # The ridge shrinks it
    assert np.sqrt(np.mean(((before - truth) / UNITS[:6]) ** 2)) < 0.2
    for outputs, inputs in GROUPS:
        others = [c for c in range(12) if c not in inputs]
        changed = window.copy()
        changed[:, others] += 1.0
        after = dut.forecast({**memory, "window": changed}, horizon=51, stride=1).offset
        np.testing.assert_array_equal(after[HORIZONS, outputs[0]], before[:, outputs[0]])


def test_no_row_is_trained_on_the_manoeuvre_that_it_is_scored_on(manoeuvres, monkeypatch):
    seen = []

    def trained(flights):
        seen.extend(log.name for log, _ in flights)
        return Hold(step=STEP)

    monkeypatch.setitem(forecast.ROWS, "mine", trained)
    found = held_out_errors({"manoeuvre": "1", "row": "mine"}, flights=manoeuvres)
    assert seen == ["made_0", "made_1", "made_4", "made_5"]
    assert list(found["known"]) == list(found["held"]) == ["made_2", "made_3"]


@pytest.mark.parametrize(
    "arguments, word",
    [([], "NP_DRAKE_REAL"), (["nowhere"], "not there"), (["nowhere", "--only", "x"], "--only")],
)
def test_bad_input_is_one_line(capfd, monkeypatch, arguments, word):
    monkeypatch.delenv("NP_DRAKE_REAL", raising=False)
    assert run(["reproduce", "payload-flights", *arguments]) == 2
    (line,) = [text for text in capfd.readouterr().err.splitlines() if text]
    assert word in line
