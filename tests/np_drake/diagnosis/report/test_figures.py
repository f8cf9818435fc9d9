"""Laws of the report's figures."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import figure_file
from np_drake.diagnosis.report.write import figures
from np_drake.figure_file import png

NAMES = ("ladder", "regimes", "timeline", "spectrum", "replay")


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Pictures are drawn with few pixels."""
    monkeypatch.setattr(figure_file, "RESOLUTION", 30)


@pytest.fixture(scope="module")
def drawn(diagnosis):
    return figures(diagnosis)


@pytest.mark.parametrize("name", NAMES)
def test_every_figure_has_labels_with_units(drawn, name):
    axes = drawn[name].get_axes()
    assert any("[" in ax.get_xlabel() for ax in axes)
    assert any("[" in ax.get_ylabel() for ax in axes) or name == "ladder"  # whose rungs have names
    assert drawn[name].legends or name == "regimes"  # whose numbers stand in it, beside a colour bar
    assert png(drawn[name]).startswith(b"\x89PNG")


def test_what_was_not_computed_is_not_drawn(diagnosis):
    where = dc.replace(diagnosis.where, regimes=(), bands=(), times={}, segments=())
    shrink = dc.replace(diagnosis.shrink, ladder=(), replay_before=None, replay_after=None)
    assert figures(dc.replace(diagnosis, where=where, shrink=shrink)) == {}


def test_a_replay_that_got_lost_and_rows_without_numbers_are_drawn(diagnosis):
    lost = dc.replace(diagnosis.shrink.replay_before, position=np.full((4, 3), np.inf))
    where = diagnosis.where
    holes = {name: np.where(np.arange(len(v))[:, None] % 7, v, np.nan) for name, v in where.before.items()}
    regimes = tuple(dc.replace(regime, rms_after=(), rms=(np.nan,) * 6) for regime in where.regimes)
    dut = dc.replace(
        diagnosis,
        where=dc.replace(where, before=holes, after={}, regimes=regimes),
        shrink=dc.replace(diagnosis.shrink, replay_before=lost, replay_after=None),
    )
    for figure in figures(dut).values():
        assert png(figure)
