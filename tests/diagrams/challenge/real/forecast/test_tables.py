import io

import numpy as np

from diagrams.challenge.real.forecast.figure import ratio_figure
from diagrams.challenge.real.forecast.rows import choose
from diagrams.challenge.real.forecast.study import HORIZONS, FlownPayload
from diagrams.challenge.real.forecast.tables import divergence_table, payload_table, ratio_tables
from diagrams.cli.output import WIDTH
from diagrams.cli.table_text import table_lines, wrapped
from np_drake.payload_filter.filter_bank import Estimate, PayloadEstimate

LINES = [
    {
        "row": row,
        "motion": motion,
        "kind": kind,
        "horizon": h,
        "rmse": 1.0,
        "ratio": ratio,
        "interval": [0.3, 2.9],
    }
    for motion in ("known", "held")
    for kind in ("lateral force", "force", "torque")
    for row in choose([])
    for h, ratio in zip(HORIZONS, (12.34, 0.5, 9.99, 1e5, np.inf, 0.123, 1.0), strict=True)
]


def test_every_table_fits_the_widest_screen_without_a_folded_cell():
    lost = {"known": ["a"], "held": []}
    models = [{"row": row, "flights": 25, "diverged": lost} for row in choose([])]
    flown = [payload("06-10", 0.111, 0.222)]
    held = payload_table(flown, flown[0].estimate, (0.09, 0.17))
    for table in [*ratio_tables(LINES), divergence_table(models), held]:
        title, header, rows = table
        text = table_lines(title, header, rows, WIDTH)
        assert max(map(len, text)) <= WIDTH
        assert len(text) == len(wrapped(title, WIDTH)) + 2 + len(
            rows
        )  # header and the line below it


def test_a_cell_tells_what_it_is():
    title, header, rows = ratio_tables(LINES)[0]
    assert "known" in title
    assert header == ["ahead", "0.02 s", "0.1 s", "0.2 s", "0.4 s", "0.6 s", "0.8 s", "1 s"]
    assert rows[0][1:] == (
        "12.3±1.3",
        "0.50±1.30",
        "9.99±1.30",
        "1.0e+05",
        "diverges",
        "0.12±1.30",
        "1.00±1.30",
    )
    assert rows[-1] == ("asked", "", "0.50", "0.42", "0.45", "", "0.48", "")
    assert ratio_tables(LINES)[1][2][-1][0] == "told + drag*"


def payload(manoeuvre, low, high):
    """A flight whose estimates of all three have this interval."""
    return FlownPayload(
        "payload_filter",
        "a",
        manoeuvre,
        PayloadEstimate(*[Estimate(0.5 * (low + high), low, high)] * 3),
    )


def test_the_payload_is_shown_by_manoeuvre_with_its_coverage():
    payloads = [payload("one", 0.1, 0.3), payload("one", 0.3, 0.5), payload("two", 0.15, 0.25)]
    true = PayloadEstimate(Estimate(0.2, 0, 0), Estimate(0.4, 0, 0), Estimate(0.9, 0, 0))
    _, header, rows = payload_table(payloads, true, (0.26, 0.28))
    assert rows[0] == ("one", *["0.300 [0.200, 0.400]"] * 3)
    assert rows[1] == ("two", *["0.200 [0.150, 0.250]"] * 3)
    assert rows[2] == ("mean (range)", *["0.267 (0.2–0.4)"] * 3)
    assert rows[3] == ("interval holds the truth", "2 of 3", "1 of 3", "1 of 3")
    assert rows[4] == ("truth", "0.200", "0.400", "0.26–0.28")
    assert len(header) == 4


def test_both_panels_have_a_line_for_every_row_but_persistence():
    figure = ratio_figure([line for line in LINES if np.isfinite(line["ratio"])])
    assert [len(axis.lines) for axis in figure.axes] == [2 + len(choose([])) - 1] * 2
    assert len(figure.legends[0].get_texts()) == len(choose([]))
    figure.savefig(io.BytesIO())
