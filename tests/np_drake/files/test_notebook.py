"""Laws of what a notebook shows of a log and of a diagnosis."""

import dataclasses as dc
import sys

import numpy as np
import pytest

from np_drake.diagnosis.report.answer import headline
from np_drake.diagnosis.result import (
    Cause,
    ChannelGap,
    Diagnosis,
    Estimate,
    GapReduction,
    Identifiability,
    Localisation,
    Remainder,
)
from np_drake.flight_log import FlightLog

ROWS = 50
LOG = FlightLog(
    t=0.02 * np.arange(ROWS),
    p=np.tile([0.0, 1.0, 2.0], (ROWS, 1)),
    q=np.tile([1.0, 0, 0, 0], (ROWS, 1)),
    v=np.zeros((ROWS, 3)),
    w=np.zeros((ROWS, 3)),
    u=np.tile([9.81, 0, 0, 0], (ROWS, 1)),
    rotor=np.full((ROWS, 4), 500.0),
    name="<circle>",
    notes=[f"note {k}" for k in range(9)],
)
MASS = Estimate(0.25983, "kg", (0.2476, 0.2721))
LEFT = Remainder(0.01, (0.0, 0.02), 0.1, 0.0, 0.01, 0.8, 0.0)
FOUND = Diagnosis(
    vehicle="paper",
    train=("a", "b"),
    held_out=("c",),
    verdict=("suspended_payload",),
    causes=(
        Cause("suspended_payload", 0.99999, {"mass": MASS}, {}),
        Cause("thrust_scale", 0.97, {}, {}),
    ),
    identifiability=Identifiability(True, {}, {}, ()),
    localisation=Localisation(
        (ChannelGap("force x", "N", 1.0, 0.1, 0.1),), before={"c": np.zeros((4000, 6))}, times={}
    ),
    gap_reduction=GapReduction(7.1, 0.98, LEFT),
    warnings=tuple(f"warning {k}" for k in range(9)),
)


@pytest.mark.parametrize("shown, most", [(LOG, 100), (FOUND, 120)], ids=["log", "diagnosis"])
def test_an_object_prints_one_line_and_shows_a_short_table(shown, most):
    assert len(repr(shown)) < most
    assert "\n" not in repr(shown)
    page = shown._repr_html_()
    assert page.count("<table>") == 1
    assert len(page) < 3000


def test_a_log_says_name_rows_length_rate_and_input():
    assert repr(LOG) == "FlightLog('<circle>': 50 rows, 1.0 s at 50 Hz, input command)"
    page = LOG._repr_html_()
    assert "&lt;circle&gt;" in page
    assert "9.81 to 9.81" in page
    assert page.count("<p>note") == 5


def test_a_log_without_rows_prints_and_shows():
    empty = LOG.rows(0, 0)
    assert "0 rows" in repr(empty)
    assert "<table>" not in empty._repr_html_()
    assert set(empty.columns()) == set(LOG.columns())


def test_a_diagnosis_says_its_headline_and_shows_its_causes():
    said = (
        "A suspended payload of 260\u00a0g explains 99.0\u00a0% of the gap on the held-out flight"
    )
    assert headline(FOUND) == said
    shown = dc.replace(FOUND, headline=said)
    assert repr(shown) == f"Diagnosis(paper: {said})"
    page = shown._repr_html_().replace("\N{NO-BREAK SPACE}", " ")
    assert "mass 0.260 ± 0.012 kg" in page
    assert "&gt; 99.9 %" in page
    assert page.count("<p>warning") == 3


def test_the_columns_of_a_log_are_those_of_its_file(tmp_path):
    from np_drake.logs.formats.log_file import write_log

    write_log(LOG, tmp_path / "log.csv")
    assert list(LOG.columns()) == (tmp_path / "log.csv").read_text().splitlines()[0].split(",")


def test_data_frames_hold_the_values_with_the_times_as_index():
    pytest.importorskip("pandas", reason="pip install 'np_drake[notebook]'")
    frame = LOG.to_dataframe()
    np.testing.assert_array_equal(frame.index, LOG.t)
    np.testing.assert_array_equal(frame[["px", "py", "pz"]], LOG.p)
    (row,) = FOUND.to_dataframe().to_dict("records")
    assert (row["cause"], row["parameter"], row["value"], row["unit"]) == (
        "suspended_payload",
        "mass",
        0.25983,
        "kg",
    )


def test_without_pandas_a_data_frame_is_refused_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        ImportError,
        match=r"needs pandas, which is not installed; pip install 'np_drake\[notebook\]'",
    ):
        LOG.to_dataframe()


def test_a_log_draws_track_height_speed_and_thrust_with_units():
    figure = LOG.plot()
    assert all("[" in ax.get_ylabel() for ax in figure.get_axes())
    assert figure._repr_png_().startswith(b"\x89PNG")
