"""Laws of the axes and of the grid of payload, tether and speed."""

import pytest

from diagrams.batch.campaign import case_file
from diagrams.robustness.axes import BASE, FLOWN, Grid, axis_settings, distinct
from diagrams.robustness.robustness import ROWS, flight_cases

MODELS = {row.configuration: b"a model file" for row in ROWS if row.configuration}


def test_the_grid_has_every_point_and_without_payload_one_tether():
    settings = distinct(Grid().settings())
    assert len(Grid().settings()) == 5 * 5 * 5
    assert len(settings) == 4 * 5 * 5 + 5
    assert {s["length"] for s in settings if s["mass"] == 0.0} == {BASE["length"]}
    assert {s["speed"] for s in settings} == {0.5, 1.0, 1.5, 2.0, 2.5}
    for name in BASE.keys() - {"mass", "length", "speed"}:
        assert {s[name] for s in settings} == {BASE[name]}


@pytest.mark.parametrize(
    ("count", "mass"),
    [
        (2, (0.0, 0.5)),
        (3, (0.0, 0.26, 0.5)),
        (4, (0.0, 0.13, 0.38, 0.5)),
        (5, (0.0, 0.13, 0.26, 0.38, 0.5)),
    ],
)
def test_a_thinned_grid_is_evenly_spaced_and_keeps_its_ends(count, mass):
    dut = Grid().thinned(count)
    assert dut.mass == mass
    assert len(dut.length) == len(dut.speed) == count
    assert (dut.length[0], dut.length[-1], dut.speed[0], dut.speed[-1]) == (0.4, 1.6, 0.5, 2.5)
    assert {tuple(s.items()) for s in dut.settings()} <= {
        tuple(s.items()) for s in Grid().settings()
    }


@pytest.mark.parametrize("count", [1, 6])
def test_a_grid_without_ends_or_with_more_than_all_values_is_refused(count):
    with pytest.raises(ValueError, match=f"must have 2 to 5 values of each quantity; got {count}"):
        Grid().thinned(count)


def test_axes_and_grid_share_the_flights_on_which_they_meet():
    alone = flight_cases(ROWS, [1, 2], MODELS)
    both = flight_cases(ROWS, [1, 2], MODELS, grid=Grid())
    files = {case_file(case) for case in both}
    assert len(files) == len(both)
    assert {
        case_file(case) for case in alone
    } <= files  # so that a campaign of axes goes on with its grid
    settings = len(distinct([*axis_settings(FLOWN), *Grid().settings()]))
    assert (
        settings == 105 + 40 - 13
    )  # the axes' payloads, tethers and speeds, but 3 m/s, lie in the grid
    assert len(both) == 2 * len(ROWS) * settings


def test_a_case_of_another_model_is_another_case():
    other = dict.fromkeys(MODELS, b"another model")
    mine, theirs = (
        {
            case["row"]: case_file(case)
            for case in flight_cases(ROWS, [1], m, FLOWN[:0], Grid().thinned(2))
        }
        for m in (MODELS, other)
    )
    changed = {row.name for row in ROWS if mine[row.name] != theirs[row.name]}
    assert changed == {row.name for row in ROWS if row.configuration}
