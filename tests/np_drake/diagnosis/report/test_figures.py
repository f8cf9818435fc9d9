"""Laws of the report's figures."""

import dataclasses as dc
import itertools
from unittest import mock

import numpy as np
import pytest
from matplotlib.text import Text

from np_drake.diagnosis.report.figures import regime_figure, smoothed, timeline_figure
from np_drake.diagnosis.report.page import figures
from np_drake.diagnosis.result import Regime
from np_drake.files.figure_file import png

COARSE = 30  # [dots an inch]
NAMES = ("regimes", "timeline", "spectrum", "replay")


@pytest.fixture(scope="module")
def drawn(diagnosis):
    return figures(diagnosis)


def crowded(figure):
    """Texts of a figure that overlap another one, or that its edge cuts."""
    drawn = []
    with mock.patch.object(Text, "draw", lambda text, renderer: drawn.append(text)):
        figure.canvas.draw()
    boxes = [(t, t.get_window_extent()) for t in drawn if t.get_visible() and t.get_text().strip()]
    frame = figure.bbox.padded(1)
    found = {
        t.get_text()
        for t, box in boxes
        if not (frame.contains(*box.min) and frame.contains(*box.max))
    }
    level = [(t.get_text(), box.padded(-1)) for t, box in boxes if t.get_rotation() in (0, 90)]
    return found | {
        f"{a} over {b}"
        for (a, one), (b, two) in itertools.combinations(level, 2)
        if one.overlaps(two)
    }


@pytest.mark.parametrize("name", NAMES)
def test_no_text_of_a_figure_overlaps_another_or_is_cut(drawn, name):
    assert not crowded(drawn[name])


@pytest.mark.parametrize(
    "channels, groups, ranges, after", [(1, 1, 1, False), (3, 5, 1, True), (6, 5, 8, True)]
)
def test_regimes_have_room_for_their_words(channels, groups, ranges, after):
    rms = tuple(float(k < channels) * 3.2 for k in range(6))
    units = {"speed": "m/s", "thrust": "N", "height": "m", "tilt": "deg", "rate": "rad/s"}
    regimes = [
        Regime(name, unit, 0.25 * k, 0.25 * (k + 1), 90, rms, rms if after else ())
        for name, unit in list(units.items())[:groups]
        for k in range(ranges)
    ]
    assert not crowded(regime_figure(regimes))


def test_no_flight_is_cut_off_above(diagnosis):
    where = diagnosis.localisation
    louder = {name: (1 + 9 * k) * y for k, (name, y) in enumerate(where.before.items())}
    figure = timeline_figure(dc.replace(where, before=louder), {})
    for ax in figure.get_axes():
        curves = [line.get_ydata() for line in ax.get_lines() if len(line.get_ydata()) > 2]
        assert max(map(np.nanmax, curves)) < ax.get_ylim()[1]
    assert not crowded(figure)


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_has_labels_with_units(drawn, name):
    axes = drawn[name].get_axes()
    assert any("[" in ax.get_xlabel() for ax in axes)
    assert any("[" in ax.get_ylabel() for ax in axes)
    assert (
        drawn[name].legends or name == "regimes"
    )  # whose numbers stand in it, beside a colour bar
    assert png(drawn[name], COARSE).startswith(b"\x89PNG")


def test_what_was_not_computed_is_not_drawn(diagnosis):
    where = dc.replace(diagnosis.localisation, regimes=(), bands=(), times={}, segments=())
    gap_reduction = dc.replace(diagnosis.gap_reduction, replay_before=None, replay_after=None)
    assert figures(dc.replace(diagnosis, localisation=where, gap_reduction=gap_reduction)) == {}


def test_a_replay_that_got_lost_and_rows_without_numbers_are_drawn(diagnosis):
    lost = dc.replace(diagnosis.gap_reduction.replay_before, position=np.full((4, 3), np.inf))
    where = diagnosis.localisation
    holes = {
        name: np.where(np.arange(len(v))[:, None] % 7, v, np.nan)
        for name, v in where.before.items()
    }
    regimes = tuple(dc.replace(regime, rms_after=(), rms=(np.nan,) * 6) for regime in where.regimes)
    dut = dc.replace(
        diagnosis,
        localisation=dc.replace(where, before=holes, after={}, regimes=regimes),
        gap_reduction=dc.replace(diagnosis.gap_reduction, replay_before=lost, replay_after=None),
    )
    for figure in figures(dut).values():
        assert png(figure, COARSE)


def labels(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_legends_name_what_is_drawn_and_nothing_else(diagnosis, drawn):
    curves = ["nominal simulator", "with the causes"]
    assert labels(drawn["timeline"]) == [*curves, "noise", "a cause begins"]
    assert labels(drawn["spectrum"]) == [*curves, "noise"]
    assert labels(drawn["replay"]) == curves
    always = tuple(dc.replace(cause, onset={}) for cause in diagnosis.causes)
    assert "change point" in labels(figures(dc.replace(diagnosis, causes=always))["timeline"])


def test_channels_that_the_log_does_not_tell_are_not_drawn(diagnosis):
    where = diagnosis.localisation
    silent = {name: np.where(np.arange(6) < 3, y, 0.0) for name, y in where.before.items()}
    regimes = tuple(dc.replace(r, rms=(*r.rms[:3], 0.0, 0.0, 0.0)) for r in where.regimes)
    bands = tuple(
        b if b.channel.startswith("force") else dc.replace(b, before=0 * b.before)
        for b in where.bands
    )
    dut = figures(
        dc.replace(
            diagnosis, localisation=dc.replace(where, before=silent, regimes=regimes, bands=bands)
        )
    )
    assert not [ax for ax in dut["timeline"].get_axes() if "torque" in ax.get_ylabel()]
    assert not [ax for ax in dut["spectrum"].get_axes() if "torque" in ax.get_ylabel()]
    shown = [text.get_text() for text in dut["regimes"].get_axes()[0].get_yticklabels()]
    assert shown == ["force x", "force y", "force z"]


def test_a_spectrum_is_averaged_over_parts_of_an_octave():
    f = np.linspace(0.0, 25.0, 129)
    centre, mean = smoothed(f, np.ones_like(f))
    assert len(centre) < 30
    assert np.all(np.diff(centre) > 0)
    np.testing.assert_allclose(mean, 1.0)
