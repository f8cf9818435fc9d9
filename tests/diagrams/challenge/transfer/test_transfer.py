"""Laws of the transfer of the controller from the corrected simulator."""

import dataclasses as dc

import numpy as np
import pytest

from diagrams.challenge.generate.composition import compatible
from diagrams.challenge.transfer import designs
from diagrams.challenge.transfer.reality import MOST, withheld_reality
from diagrams.challenge.transfer.study import (
    CORRECTED,
    MADE_IN,
    NOMINAL,
    PLAIN,
    REAL,
    ROWS,
    SAMPLED,
    gained,
    table,
)
from diagrams.loop.reality import RealityConfig
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.effect_entry import EffectEntry
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()


@pytest.mark.parametrize("seed", range(30))
def test_withheld_effects_can_be_told_apart_and_fly(seed):
    reality = withheld_reality(seed, VEHICLE).check()
    names = tuple(entry.effect for entry in reality.effects)
    apart = tuple(n for n in names if n != "linear_drag" or "constant_wind" not in names)
    assert 1 <= len(apart) <= MOST
    assert len(apart) == 1 or compatible(apart)
    assert withheld_reality(seed, VEHICLE) == reality


def test_the_nominal_simulator_has_no_effects():
    assert RealityConfig().nominal().everything() == []


def result(nominal, corrected, real, foretold_nominal, foretold_corrected):
    """Case with these level errors and none vertical; None: lost."""

    def errors(value):
        return [value, None if value is None else 0.0]

    made = {NOMINAL: nominal, CORRECTED: corrected, SAMPLED: corrected}
    foretold = {
        NOMINAL: foretold_nominal,
        CORRECTED: foretold_corrected,
        SAMPLED: foretold_corrected,
    }
    flown = made | dict.fromkeys(REAL, real) | dict.fromkeys(PLAIN, 1.0)
    return {
        "errors": {row: errors(value) for row, value in flown.items()},
        "foretold": {row: errors(value) for row, value in foretold.items()},
        "chosen": dict.fromkeys(MADE_IN, "hold"),
    }


def test_gains_are_medians_of_ratios():
    found = gained(
        [
            result(1.0, 0.5, 0.4, 0.2, 0.45),
            result(2.0, 0.2, 0.2, 0.2, 0.2),
            result(1.0, 0.3, 0.3, 0.5, 0.3),
        ]
    )
    assert found["fall of E_xy"] == pytest.approx(0.7)
    assert found["E_xy over real flights"] == pytest.approx(1.0)
    assert found["E_xy foretold by: nominal simulator"] == pytest.approx(0.8)
    assert found["E_xy foretold by: corrected simulator"] == pytest.approx(0.0)
    assert found["fall of E"] == found["fall of E_xy"]


def test_the_better_of_the_predictors_from_real_flights_counts():
    one = result(1.0, 0.4, 0.8, 0.2, 0.4)
    one["errors"][REAL[1]] = [0.2, 0.0]
    assert gained([one])["E_xy over real flights"] == pytest.approx(2.0)


def test_a_lost_vehicle_counts_as_infinitely_bad():
    lost, flown = result(1.0, None, 0.4, 0.2, 0.45), result(1.0, 0.5, 0.5, 0.2, 0.5)
    assert gained([lost])["fall of E_xy"] == -np.inf
    assert np.isfinite(gained([lost, flown, flown])["fall of E_xy"])
    assert gained([lost])["E_xy foretold by: corrected simulator"] == np.inf
    assert np.isnan(gained([result(None, None, None, 0.2, 0.45)])["fall of E_xy"])


def test_the_table_has_quartiles_and_counts_what_was_lost_and_chosen():
    results = [result(value, 0.1, 0.1, 0.1, 0.1) for value in (0.1, 0.2, 0.3, 0.4, None)]
    lines = {line["row"]: line for line in table(results)}
    assert [lines[NOMINAL][key] for key in ("lower", "median", "upper")] == [0.2, 0.3, 0.4]
    assert lines[NOMINAL]["lost"] == 1
    assert lines[NOMINAL]["chosen"] == "hold 5"
    assert lines["oracle"]["chosen"] == ""
    assert tuple(lines) == ROWS


def test_the_design_with_the_least_mean_error_in_space_is_chosen(monkeypatch, tmp_path):
    errors = {"nominal": (0.1, 0.9), "hold": (0.4, 0.4), "observer": (0.6, 0.3), "np": (0.5, 0.5)}
    monkeypatch.setattr(designs, "_training_logs", lambda *_: [])
    monkeypatch.setattr(designs, "learned", lambda *_: [designs.Design("np", "x.safetensors")])
    monkeypatch.setattr(designs, "flown", lambda design, *_, **__: errors[design.kind])
    world = RealityConfig().nominal()
    found = designs.chosen_in([world, world], VEHICLE, solver="sqp", seed=0, folder=tmp_path)
    assert (found.design.kind, found.foretold) == ("hold", (0.4, 0.4))


def test_a_design_is_told_the_delay_of_its_simulator_or_estimates_it():
    late = dc.replace(RealityConfig().nominal(), effects=[EffectEntry.of(CommandDelay(0.03))])
    told = designs.Design("hold", delay=late.dead_time).config(late, VEHICLE, "sqp").controller
    assert (told.command_delay, told.track_delay) == (0.03, False)
    estimating = designs.Design("np", delay=None).config(late, VEHICLE, "sqp").controller
    assert (estimating.command_delay, estimating.track_delay) == (0.0, True)


def test_a_lost_vehicle_has_infinite_errors():
    heavy = dc.replace(RealityConfig().nominal(), effects=[EffectEntry.of(CommandDelay(0.25))])
    assert (
        designs.flown(designs.Design("nominal"), heavy, VEHICLE, solver="sqp", seed=0)
        == designs.LOST
    )
