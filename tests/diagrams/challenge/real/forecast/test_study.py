import json

import numpy as np
import pytest

from diagrams.challenge.real.forecast import folds, study
from diagrams.challenge.real.forecast.folds import open_campaign
from diagrams.challenge.real.forecast.rows import PERSISTENCE, TOLD, TOLD_WITH_DRAG, choose
from diagrams.challenge.real.forecast.study import estimate_at_end, run_study, steps_of
from np_drake.files.atomic_file import plain
from np_drake.payload_filter.model_file import PayloadFilterModel
from np_drake.payload_filter.predictor import PayloadFilter
from np_drake.vehicle.scaling import scales


class Here:
    """Workers in this process, where what a test replaces is replaced."""

    def run(self, work, cases, **_):
        return [
            {"case": case, "result": json.loads(json.dumps(plain(work(case))))} for case in cases
        ]


def ratios(lines, row, *, motion="known", kind="lateral force"):
    """Ratio to persistence by horizon of one row."""
    return {
        round(line["horizon"], 3): line["ratio"]
        for line in lines
        if (line["row"], line["motion"], line["kind"]) == (row, motion, kind)
    }


def test_the_oracle_pendulum_is_near_zero_and_persistence_is_one(cones, payload, monkeypatch):
    monkeypatch.setattr(folds, "true_payload", lambda: payload)
    lines = run_study(cones, [PERSISTENCE, TOLD, TOLD_WITH_DRAG], step=0.02, workers=Here()).lines()
    assert set(ratios(lines, PERSISTENCE).values()) == {1.0}
    for row in (TOLD, TOLD_WITH_DRAG):
        assert (
            max(r for h, r in ratios(lines, row).items() if h >= 0.1) < 0.05
        )  # of a swing of 1.5 s


def test_no_row_is_trained_on_the_manoeuvre_that_it_is_scored_on(cones, monkeypatch):
    seen, models = [], study.HoldingOut._models

    def trained_on(self, name, learned, held_out):
        seen.append(sorted(flight.log.name for flight in learned))
        return models(self, name, learned, held_out)

    monkeypatch.setattr(study.HoldingOut, "_models", trained_on)
    found = run_study(cones, [PERSISTENCE, "linear"], step=0.02, workers=Here())
    held_out = [["00", "01"], ["10", "11"], ["20", "21"]]
    everything = sorted(flight.log.name for flight in cones)
    assert seen == [[n for n in everything if n not in fold] for fold in held_out for _ in range(2)]
    scored = [s.flight for s in found.scores if (s.row, s.motion) == ("linear", "known")]
    assert scored == everything


def test_the_filters_tell_the_payload_at_the_end_of_a_flight(cones, payload):
    flight = cones[-1]
    arm = scales(flight.vehicle).length
    model = PayloadFilterModel(
        0.02, flight.vehicle.mass, 9.81, 0.0, 0.0, 0.01, 0.0, 0.02, np.zeros(3), arm=arm
    )
    found = estimate_at_end(PayloadFilter(model), flight)
    assert found.mass.low < payload.mass / flight.vehicle.mass < found.mass.high
    assert found.length.low < payload.length < found.length.high


def test_horizons_are_whole_steps():
    assert steps_of((0.02, 0.1, 1.0), 0.02) == [1, 5, 50]
    assert steps_of((0.001, 0.1), 0.01) == [1, 10]


def test_persistence_is_always_a_row_and_an_unknown_row_is_refused():
    assert choose(["ridge"]) == [PERSISTENCE, "ridge"]
    assert {PERSISTENCE, "ridge", TOLD} <= set(choose([]))
    with pytest.raises(ValueError, match="--only"):
        choose(["oracle of Delphi"])


def test_a_folder_needs_two_manoeuvres(tmp_path):
    with pytest.raises(ValueError, match="not there"):
        open_campaign(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="two manoeuvres"):
        open_campaign(tmp_path)


def test_on_the_real_flights_a_ridge_does_what_the_prototype_did(real_flights):
    flights = open_campaign(real_flights)
    names = [PERSISTENCE, "training mean", "ridge", "delay DMDc", TOLD_WITH_DRAG]
    lines = run_study(flights, names, step=0.02).lines()
    at = (0.1, 0.2, 0.4, 0.8)  # s
    asked = {"ridge": (0.54, 0.48, 0.55, 0.54), "training mean": (1.97, 1.13, 0.73, 0.57)}
    for row, wanted in asked.items():
        got = [ratios(lines, row)[h] for h in at]
        np.testing.assert_allclose(
            got, wanted, rtol=0.1
        )  # its labels were not described to the last bit
    upper = ratios(lines, TOLD_WITH_DRAG)
    assert all(upper[h] < ratios(lines, "ridge")[h] for h in at)
    assert len({flight.manoeuvre for flight in flights}) == 5
