"""The bound against the error on real flights, and the models that violate an assumption."""

import dataclasses as dc

import pytest

from diagrams.batch.run import Run
from diagrams.prediction import array_flights, theorem
from np_drake.lifting.training.train import make_config, train


@pytest.fixture(scope="module")
def flown(neurobem):
    """One second of every flight."""
    flights = array_flights.flights(neurobem)
    return [dc.replace(f, segment=_second(f.segment)) for f in flights]


def _second(segment):
    parts = {"chi": segment.chi, "zeta": segment.zeta, "target": segment.goal}
    return dc.replace(segment, **{name: part[3200:3600] for name, part in parts.items()})


@pytest.fixture(scope="module")
def lines(flown):
    segments = [flown[0].segment]
    models = {
        "paper": train(segments, make_config("paper", epochs=1)).model,
        "mode-dictionary": train(
            segments, make_config("mode-dictionary", frame="body", horizon=100)
        ).model,
    }
    return theorem.bound_table(Run(), models, flown, spacing=1, config={})


def of(lines, alpha, *models):
    return [line for line in lines if line["alpha"] == alpha and line["model"] in models]


def test_the_bound_holds_in_every_window_of_every_real_flight(lines, flown):
    own = of(lines, "own", "paper", "mode-dictionary")
    assert len(own) == 2 * len(flown)
    assert sum(line["windows"] for line in own) > 4000
    assert all(line["premise"] == line["holds"] == 1.0 for line in own)


def test_it_holds_where_alphas_known_before_the_flight_hold(lines):
    foreseen = of(lines, "others", "paper", "mode-dictionary")
    assert any(line["premise"] > 0.9 for line in foreseen)
    assert all(line["holds_on_premise"] == 1.0 for line in foreseen if line["premise"] > 0)


def test_it_is_no_empty_bound(lines):
    for line in of(lines, "own", "paper"):  # median of bound / error; spikes of chi set alpha
        assert line["tightness"]["z"][1][0] < 100.0


def test_a_sound_model_violates_nothing_and_every_line_is_in_the_table(lines, flown):
    assert all(not line["violated"] for line in of(lines, "own", "paper"))
    _, header, rows = theorem.printed(lines)
    assert [row[0] for row in rows if not row[0].startswith("  ")] == ["paper", "mode-dictionary"]
    assert len(rows) - 2 == len(lines) == 2 * 2 * len(flown)
    assert all(len(row) == len(header) for row in rows)
    broken = {**of(lines, "own", "paper")[0], "violated": {"stability": 0.25}}
    assert "violated: stability in 25 % of windows" in theorem.assumption_lines([broken])[-1]
