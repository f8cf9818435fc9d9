"""The bound against the error on real flights, and the models that violate an assumption."""

import dataclasses as dc

import pytest

from diagrams.batch.run import Run
from diagrams.prediction import array_flights, theorem
from np_drake.lifting.training.train import make_config, train


@pytest.fixture(scope="module")
def flown(neurobem):
    """One second of every flight."""
    return [
        dc.replace(
            f, segment=dc.replace(f.segment, **{k: v[3200:3600] for k, v in parts(f).items()})
        )
        for f in array_flights.flights(neurobem)
    ]


def parts(flight):
    return {"chi": flight.segment.chi, "zeta": flight.segment.zeta, "target": flight.segment.goal}


@pytest.fixture(scope="module")
def lines(flown):
    segments = [flown[0].segment]
    models = {
        "paper": train(segments, make_config("paper", epochs=1)).model,
        "delay-dmdc": train(segments, make_config("delay-dmdc")).model,
    }
    return theorem.bound_table(Run(), models, flown, spacing=1, config={})


def of(lines, alpha, *models):
    return [line for line in lines if line["alpha"] == alpha and line["model"] in models]


def test_the_bound_holds_in_every_window_of_every_real_flight(lines, flown):
    own = of(lines, "own", "paper", "delay-dmdc")
    assert len(own) == 2 * len(flown)
    assert sum(line["windows"] for line in own) > 4000
    assert all(line["premise"] == line["holds"] == 1.0 for line in own)


def test_it_holds_where_alphas_known_before_the_flight_hold(lines):
    foreseen = of(lines, "others", "paper", "delay-dmdc")
    assert any(line["premise"] > 0.9 for line in foreseen)
    assert all(line["holds_on_premise"] == 1.0 for line in foreseen if line["premise"] > 0)


def test_it_is_no_empty_bound(lines):
    for line in of(lines, "own", "paper"):
        assert (
            line["tightness"]["z"][1][0] < 100.0
        )  # median of bound / error; spikes of chi set alpha
        assert line["tightness"]["z"][40][0] < line["tightness"]["operator"][40][0]


def test_a_sound_model_violates_nothing_and_a_broken_one_what_was_broken(lines):
    assert all(not line["violated"] for line in of(lines, "own", "paper", "delay-dmdc"))
    broken = {line["model"]: set(line["violated"]) for line in lines[-3:]}
    assert broken == {
        "A not stable, no refit": {"stability"},
        "Phi not normalised": {"Lipschitz constant"},
        "alphas halved": {"step of chi", "step of zeta"},
    }


def test_the_table_has_a_row_for_every_line_and_one_for_every_model(lines, flown):
    _, header, rows = theorem.printed(lines)
    models = [row[0] for row in rows if not row[0].startswith("  ")]
    assert models == [
        "paper",
        "delay-dmdc",
        "A not stable, no refit",
        "Phi not normalised",
        "alphas halved",
    ]
    assert len(rows) - len(models) == len(lines) == 2 * 2 * len(flown) + 3
    assert all(len(row) == len(header) for row in rows)


def test_the_lines_below_say_what_was_violated_and_where(lines):
    said = theorem.assumption_lines(lines)
    assert [line for line in said if "violated: stability in 100 % of windows" in line]
    assert not [
        line
        for line in said
        if line.startswith("  ") and "alphas own" in line and "step of chi" in line
    ]
