"""Laws of the cases: the rule is that of names, no flight judges itself, and what is missing is said in a line."""

from pathlib import Path

import pytest

from diagrams.challenge.real.campaigns import block_name, flown_in_wind, numbered_blocks, wind_speed
from diagrams.challenge.real.cases import (
    GROUPS,
    OfNamedCase,
    across_blocks,
    block_pairs,
    into_wind,
    make_cases,
    within_wind,
)

BLOCKS = (range(6, 11), range(17, 22), (43, 45, 46), range(57, 62))
WINDS = ("nowind", "35wind", "100wind")
CONTROLLERS = ("baseline", "indi", "pid")


@pytest.fixture
def folder(tmp_path) -> Path:
    """Empty files with the names of flights."""
    for place in ("imrc/bare", "imrc/payload", "neural_fly"):
        (tmp_path / place).mkdir(parents=True)
    for block in BLOCKS:
        for number in block:
            (tmp_path / "imrc" / "payload" / f"flight{number:02}").touch()
    for wind in WINDS:
        for controller in CONTROLLERS:
            (tmp_path / "neural_fly" / f"custom_figure8_{controller}_{wind}.csv.gz").touch()
    return tmp_path


def paths(numbers, stem="flight") -> list[Path]:
    return [Path(f"{stem}{n:02}") for n in numbers]


def test_a_block_is_of_consecutive_numbers_with_at_most_one_missing():
    blocks = numbered_blocks(reversed([path for block in BLOCKS for path in paths(block)]))
    assert [block_name(block) for block in blocks] == ["06-10", "17-21", "43-46", "57-61"]


def test_a_block_has_one_stem_and_a_flight_has_a_number():
    found = numbered_blocks([*paths([1, 2]), *paths([3], "other"), Path("README")])
    assert [len(block) for block in found] == [2, 1]


@pytest.mark.parametrize(
    "setting, speed", [("nowind", 0.0), ("35wind", 4.2), ("70wind", 8.5), ("100wind", 12.1), ("70p20sint", 8.5)]
)
def test_the_speed_of_the_wind_is_in_proportion_to_the_fans(setting, speed):
    assert wind_speed(setting) == pytest.approx(speed, abs=0.05)  # m/s, as the data set rounds


def test_every_ordered_pair_of_blocks_is_a_case_of_the_first_two_flights():
    blocks = [paths(block) for block in BLOCKS]
    cases = list(block_pairs("payload", blocks))
    assert len(cases) == 4 * 3
    assert len({case.name for case in cases}) == len(cases)
    assert (cases[0].train, cases[0].held_out) == (tuple(paths([6, 7])), Path("flight17"))


def test_a_block_of_one_flight_judges_but_is_not_fitted():
    cases = list(block_pairs("payload", [paths([1]), paths([5, 6])]))
    assert [(case.train, case.held_out) for case in cases] == [(tuple(paths([5, 6])), Path("flight01"))]


def test_every_block_judges_once_and_is_not_fitted_then():
    blocks = [paths(block) for block in BLOCKS]
    cases = list(across_blocks("payload", blocks))
    assert [case.held_out for case in cases] == [block[-1] for block in blocks]
    for case, block in zip(cases, blocks, strict=True):
        assert len(case.train) == 2
        assert not set(case.train) & set(block)
    assert not list(across_blocks("payload", blocks[:2]))


def test_in_every_wind_each_controller_is_held_out_once():
    flown = flown_in_wind(Path(f"custom_figure8_{c}_{w}.csv") for c in CONTROLLERS for w in WINDS)
    cases = list(within_wind(flown))
    assert len(cases) == 9
    assert sum(case.group == "still" for case in cases) == 3
    for case in cases:
        assert all(path.name.endswith(case.held_out.name.split("_")[-1]) for path in case.train)
        assert len({path.name.split("_")[2] for path in (*case.train, case.held_out)}) == 3
        assert {p.name.split("_")[2] for p in case.still} == {p.name.split("_")[2] for p in case.train}


def test_into_wind_the_fit_is_still_air_of_other_controllers():
    flown = flown_in_wind(Path(f"custom_figure8_{c}_{w}.csv") for c in CONTROLLERS for w in WINDS)
    cases = list(into_wind(flown))
    assert len(cases) == 6
    for case in cases:
        assert all("nowind" in path.name for path in case.train)
        assert "nowind" not in case.held_out.name
        assert case.held_out.name.split("_")[2] not in {path.name.split("_")[2] for path in case.train}
        assert case.speed > 0


def test_no_flight_judges_what_was_fitted_to_it_and_names_differ(folder):
    cases = make_cases(folder)
    assert {case.group for case in cases} == {"payload", "payload-command", "wind", "still", "new-wind"}
    assert all(case.held_out not in case.train for case in cases)
    assert len({(case.group, case.name) for case in cases}) == len(cases)


def test_a_record_leads_to_the_case_of_its_name(folder):
    case = make_cases(folder)[3]
    found = OfNamedCase(lambda case: {"held_out": case.held_out}, folder, None)
    assert found({"group": case.group, "name": case.name}) == {"held_out": case.held_out}


def test_only_some_groups_are_made_where_they_are_named(folder):
    assert {case.group for case in make_cases(folder, only=["still"])} == {"still"}


def test_what_cannot_be_made_is_said_in_one_line(folder, tmp_path):
    with pytest.raises(ValueError, match="not there"):
        make_cases(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="got none"):
        make_cases(folder, only=["bare"])
    with pytest.raises(ValueError, match=f"must be of {GROUPS[0]}"):
        make_cases(folder, only=["storm"])
