"""Laws of the campaigns of real flights: names decide which flights judge, none judges its own fit,
and what is not known is neither right nor wrong.
"""

from pathlib import Path

import pytest

from diagrams.evidence.real import campaigns as real
from diagrams.evidence.real.campaigns import (
    DRAG,
    GROUPS,
    block_name,
    by_blocks,
    campaign_of,
    in_circle,
    make_cases,
    numbered_blocks,
)
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.library import BESIDE_NEIGHBOURS, LIBRARY

BLOCKS = (range(6, 11), range(17, 22), (43, 45, 46), range(57, 62))
WINDS = ("nowind", "35wind", "100wind")
CONTROLLERS = ("baseline", "indi", "pid")
FLOWN = [Path(f"custom_figure8_{c}_{w}.csv") for c in CONTROLLERS for w in WINDS]
FILES = (  # of all campaigns, as they are named there
    *(f"imrc/payload/flight{n:02}" for block in BLOCKS for n in block),
    *(f"imrc/bare/flight{n:02}" for n in (0, 1, 2, 12, 13, 22, 23)),
    *(f"neural_fly/{path}" for path in FLOWN),
    *(f"idsia/{kind}_run{n}.parquet" for kind in ("melon", "random1", "zoo") for n in (1, 2)),
    *(f"nanobench/dataset_B{n}_{k}_rep1.csv.gz" for n, k in enumerate(("oval", "star"))),
    *(
        f"crazyswarm2/{kind}/{name}{n}"
        for kind in ("standard", "upgraded", "payload")
        for n in (1, 3, 5)
        for name in ("log", "info")
    ),
    *(
        f"neural_swarm/{kind}/walk_{kind}_{name}_0{n}.gz"
        for kind in ("ground", "single")
        for name in ("cf50", "cf101")
        for n in (1, 2)
    ),
    *(f"neural_swarm/downwash/cf5{v}_0{n}.gz" for v in (0, 1) for n in (0, 2)),
    *(
        f"cut_blade/cut{c}mm_{m}_{n}.gz"
        for c in ("00", 10, 25)
        for m in ("hover", "line")
        for n in "12"
    ),
)


def paths(numbers, stem="flight") -> list[Path]:
    return [Path(f"{stem}{n:02}") for n in numbers]


ALL = [path for block in BLOCKS for path in paths(block)]


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Empty files of all campaigns; what lies in `single` flew high."""
    for name in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    high = lambda path: 0.8 if path.parent.name == "single" else 0.1  # noqa: E731
    monkeypatch.setattr(real, "exceeded_height", high)
    return tmp_path


# Rules


def test_a_block_is_of_consecutive_numbers_of_one_stem():
    names = [block_name(block) for block in numbered_blocks(reversed(ALL))]
    assert names == ["06-10", "17-21", "43-46", "57-61"]
    found = numbered_blocks([*paths([1, 2]), *paths([3], "other"), Path("README")])
    assert [len(block) for block in found] == [2, 1]


def test_a_block_is_fitted_and_the_next_one_judges():
    cases = [case for case in by_blocks("payload", ALL) if "+" not in case.name]
    assert [(case.train, case.held_out) for case in cases] == [
        (tuple(paths([6, 7])), Path("flight17")),
        (tuple(paths([17, 18])), Path("flight43")),
        (tuple(paths([43, 45])), Path("flight57")),
        (tuple(paths([57, 58])), Path("flight06")),
    ]
    (single,) = by_blocks("payload", paths([1, 5, 6]))  # a block of one flight is not fitted
    assert (single.train, single.held_out) == (tuple(paths([5, 6])), Path("flight01"))


@pytest.mark.parametrize("flights, fitted", [(5, 2), (2, 1)])
def test_in_a_circle_every_flight_judges_once(flights, fitted):
    files = paths(range(flights))
    cases = list(in_circle("bare", files))
    assert [case.held_out for case in cases] == files
    assert all(len(case.train) == fitted and case.held_out not in case.train for case in cases)
    assert not list(in_circle("bare", files[:1]))


# Cases


def test_no_flight_judges_its_own_fit_and_folders_of_answers_differ(folder):
    cases = make_cases(folder)
    assert {case.group for case in cases} == set(GROUPS) - {"neurobem"}
    assert all(case.held_out not in case.train and case.train for case in cases)
    assert len({case.folder for case in cases}) == len(cases)
    assert all(len(case.folder.parts) == 2 for case in cases)
    for group in GROUPS[:-1]:
        judging = [case.held_out for case in cases if case.group == group]
        assert len(judging) <= campaign_of(group).most
        assert max(map(judging.count, judging)) <= 2
        assert not any(path.name.startswith(("info", "pid_mell", "LOG")) for path in judging)


def test_what_cannot_be_made_is_said_in_one_line(folder, tmp_path):
    with pytest.raises(ValueError, match="not there"):
        make_cases(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="got none"):
        make_cases(folder / "idsia")
    with pytest.raises(ValueError, match=f"must be of {GROUPS[0]}"):
        make_cases(folder, only=["storm"])


def test_flights_before_are_none_that_are_fitted_or_judge(folder):
    for case in make_cases(folder, only=["bare-since", "payload-since"]):
        assert len({*case.before, *case.train, case.held_out}) == 2 + len(case.train) + 1
        assert all(path.parent.name == "bare" for path in case.before)
    assert not any(case.before for case in make_cases(folder, only=["bare"]))


# Truth


@pytest.mark.parametrize("group", GROUPS)
def test_a_false_name_makes_an_answer_wrong_and_a_silent_one_does_not(group):
    truth = campaign_of(group).truth
    library = {*LIBRARY, *BESIDE_NEIGHBOURS, UNKNOWN}
    assert truth.source
    assert {*truth.present, DRAG, *truth.false} <= library
    assert not {*truth.present, DRAG} & set(truth.false)
    assert not (truth.healthy and truth.present)
    present = {truth.present[0]: 0.6} if truth.present else {}
    assert truth.right({**present, DRAG: 0.9})
    assert truth.right({}) == (not truth.present)
    for name in truth.false:
        assert truth.wrong({**present, name: 0.6}) == [name]
        assert not truth.right({**present, name: 0.6})
        assert truth.right({**present, name: 0.4})
