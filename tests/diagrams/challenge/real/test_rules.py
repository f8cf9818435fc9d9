"""Laws of the rules of cases: names decide, every flight gets its turn, and none judges its own
fit.
"""

from pathlib import Path

import pytest

from diagrams.challenge.real.rules import (
    across_blocks,
    block_by_block,
    by_manoeuvre,
    by_vehicle,
    in_circle,
    in_still_air,
    in_wind,
    into_wind,
)

BLOCKS = (range(6, 11), range(17, 22), (43, 45, 46), range(57, 62))
WINDS = ("nowind", "35wind", "100wind")
CONTROLLERS = ("baseline", "indi", "pid")
FLOWN = [Path(f"custom_figure8_{c}_{w}.csv") for c in CONTROLLERS for w in WINDS]


def paths(numbers, stem="flight") -> list[Path]:
    return [Path(f"{stem}{n:02}") for n in numbers]


ALL = [path for block in BLOCKS for path in paths(block)]


def test_a_block_is_fitted_and_the_next_one_judges():
    cases = list(block_by_block("payload", ALL))
    assert [(case.train, case.held_out) for case in cases] == [
        (tuple(paths([6, 7])), Path("flight17")),
        (tuple(paths([17, 18])), Path("flight43")),
        (tuple(paths([43, 45])), Path("flight57")),
        (tuple(paths([57, 58])), Path("flight06")),
    ]


def test_a_block_of_one_flight_judges_but_is_not_fitted():
    cases = list(block_by_block("payload", paths([1, 5, 6])))
    assert [(case.train, case.held_out) for case in cases] == [
        (tuple(paths([5, 6])), Path("flight01"))
    ]


def test_every_block_judges_once_and_is_not_fitted_then():
    cases = list(across_blocks("payload", ALL))
    assert [case.held_out.name for case in cases] == [
        "flight10",
        "flight21",
        "flight46",
        "flight61",
    ]
    for case, block in zip(cases, BLOCKS, strict=True):
        assert len(case.train) == 2
        assert not set(case.train) & set(paths(block))
    assert not list(across_blocks("payload", ALL[:10]))


@pytest.mark.parametrize("flights, fitted", [(5, 2), (2, 1)])
def test_in_a_circle_every_flight_judges_once(flights, fitted):
    files = paths(range(flights))
    cases = list(in_circle()("bare", files))
    assert [case.held_out for case in cases] == files
    assert all(len(case.train) == fitted and case.held_out not in case.train for case in cases)
    assert not list(in_circle()("bare", files[:1]))


def test_of_every_manoeuvre_the_first_judges_the_last_of_others():
    files = [
        Path(f"{kind}_run{n}.parquet") for kind in ("melon", "random", "square") for n in (2, 4)
    ]
    first, *_ = cases = list(by_manoeuvre(r"([^_]+)_")("idsia", files))
    assert [case.name for case in cases] == ["melon_run2", "random_run2", "square_run2"]
    assert [path.name for path in first.train] == ["random_run4.parquet", "square_run4.parquet"]


def test_of_every_vehicle_the_last_judges_those_before_it():
    files = [Path(f"cf5{v}_{n:02}.gz") for v in (0, 1) for n in range(4)] + [Path("cf52_00.gz")]
    cases = list(by_vehicle(r"(cf\d+)_")("swarm-downwash", files))
    assert [case.name for case in cases] == ["cf50_03", "cf51_03"]
    assert [path.name for path in cases[1].train] == ["cf51_01.gz", "cf51_02.gz"]


@pytest.mark.parametrize("rule, count", [(in_wind, 6), (in_still_air, 3)])
def test_in_every_wind_each_controller_is_held_out_once(rule, count):
    cases = list(rule("wind", FLOWN))
    assert len(cases) == count
    for case in cases:
        assert all(path.name.endswith(case.held_out.name.split("_")[-1]) for path in case.train)
        assert len({path.name.split("_")[2] for path in (*case.train, case.held_out)}) == 3
        if case.speed:
            assert {p.name.split("_")[2] for p in case.still} == {
                p.name.split("_")[2] for p in case.train
            }


def test_into_wind_the_fit_is_still_air_of_other_controllers():
    cases = list(into_wind("new-wind", FLOWN))
    assert len(cases) == 6
    for case in cases:
        assert all("nowind" in path.name for path in case.train)
        assert "nowind" not in case.held_out.name
        assert case.held_out.name.split("_")[2] not in {
            path.name.split("_")[2] for path in case.train
        }
        assert case.speed > 0
        assert case.second
