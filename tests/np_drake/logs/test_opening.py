"""Laws of neighbours' logs: whose they are, on which clock, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.logs.errors import LogError
from np_drake.logs.import_sheet import Sheet, read_sheet, write_sheet
from np_drake.logs.opening import neighbour_of, with_neighbours

A, B = Path("here/a.csv"), Path("here/b.csv")
LEAST = 0.1  # [m]


def log(name="a", start=0.0, seconds=10.0, height=1.0, **more):
    """A flight that hovers."""
    t = np.arange(0.0, seconds, 0.01)
    p, q = np.tile([0.0, 0.0, height], (len(t), 1)), np.tile([1.0, 0, 0, 0], (len(t), 1))
    still = np.zeros((len(t), 3))
    return FlightLog(
        t=t, p=p, q=q, v=still, w=still, u=np.zeros((len(t), 4)), name=name, start=start, **more
    )


def test_a_neighbour_is_on_the_clock_of_the_flight():
    moving = log("b", start=103.0, height=2.0)
    moving.p[:, 0] = moving.t + moving.start  # its place tells the time of its recording
    (dut,) = with_neighbours([log(start=100.0)], {"a": [moving]}, LEAST)
    (path,) = dut.neighbours
    np.testing.assert_allclose(path.at(5.0), [105.0, 0.0, 2.0], atol=1e-9)
    assert np.isnan(path.at(2.9)).all()
    assert "beside b for 70 % of the flight" in dut.notes[-1]


BAD = {
    "apart": (
        {"a": [log("b", start=20.0, height=2.0)]},
        "b: must have 1 s in common with a, which is of 0",
    ),
    "same": ({"a": [log("b")]}, "b: must stay 0.1 m away from a; they are 0 m apart"),
    "no position": ({"a": [log("b", lacks=("height",))]}, "b: must tell the position"),
    "no flight": ({"c": [log("b")]}, "neighbours: must be of a; got 'c'"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_neighbour_is_refused_in_one_line(name):
    neighbours, says = BAD[name]
    with pytest.raises(LogError, match=says) as caught:
        with_neighbours([log()], neighbours, LEAST)
    assert "\n" not in str(caught.value)


def test_the_sheet_of_an_import_keeps_the_clock(tmp_path):
    write_sheet(Sheet(0.001, {}, start=1234.5), tmp_path / "a.csv")
    assert read_sheet(tmp_path / "a.csv").start == 1234.5
    (tmp_path / "a.import.yaml").write_text("timing: 0.0\nstart: .nan\n")
    with pytest.raises(LogError, match="start must be a time"):
        read_sheet(tmp_path / "a.csv")


def test_an_option_names_a_log_and_whose_neighbour_it_is():
    assert neighbour_of("n.csv=b.csv", [A, B]) == (Path("n.csv"), B)
    assert neighbour_of(f"n.csv={A}", [A, B]) == (Path("n.csv"), A)
    for text in ("n.csv=c.csv", "=a.csv", "n.csv"):
        with pytest.raises(ValueError, match=r"LOG=OF; OF must be one of a\.csv, b\.csv"):
            neighbour_of(text, [A, B])
