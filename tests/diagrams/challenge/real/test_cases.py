"""Laws of the cases: the rule is that of names, no flight judges itself, and what is missing is
said in a line.
"""

from pathlib import Path

import pytest

from diagrams.challenge.real import cases as module
from diagrams.challenge.real.campaigns import CAMPAIGNS, GROUPS, campaign_of
from diagrams.challenge.real.cases import OfNamedCase, evenly, make_cases

BLOCKS = (range(6, 11), range(17, 22), (43, 45, 46), range(57, 62))
WINDS = ("nowind", "35wind", "100wind")
CONTROLLERS = ("baseline", "indi", "pid")
FILES = (  # of all other campaigns, as they are named there
    *(f"imrc/bare/flight{n:02}" for n in (0, 1, 2, 12, 13, 22, 23)),
    *(
        f"idsia/{kind}_run{n}.parquet"
        for kind in ("melon", "random1", "square", "zigzag", "zoo")
        for n in (1, 2)
    ),
    *(
        f"nanobench/dataset_B{n}_{kind}_fast_rep1.csv.gz"
        for n, kind in enumerate(("circle", "oval", "star"))
    ),
    "nanobench/pid_mell_data_mell_aligned.csv.gz",
    *(
        f"crazyswarm2/{kind}/{name}{n}"
        for kind in ("standard", "upgraded", "payload")
        for n in (1, 3, 5)
        for name in ("log", "info")
    ),
    *(
        f"neural_swarm/{kind}/walk_{name}_0{n}.gz"
        for kind in ("ground", "single")
        for name in ("cf50", "cf101")
        for n in (1, 2)
    ),
    *(f"neural_swarm/downwash/cf5{v}_0{n}.gz" for v in (0, 1) for n in (0, 2)),
    "indiflight/LOG00231.BFL",
)


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


@pytest.fixture
def everything(folder, monkeypatch) -> Path:
    """The folder with files of all campaigns; what lies in `single` flew high."""
    for name in FILES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    monkeypatch.setattr(
        module, "exceeded_height", lambda path, log_map: 0.8 if "single" in str(path) else 0.1
    )
    return folder


def test_no_flight_judges_its_own_fit_and_folders_of_answers_differ(everything):
    cases = make_cases(everything)
    assert {case.group for case in cases} == set(GROUPS) - {"neurobem"}
    assert all(case.held_out not in case.train and case.train for case in cases)
    assert (
        len({case.folder for case in cases})
        == len({(case.group, case.name) for case in cases})
        == len(cases)
    )
    assert all(len(case.folder.parts) == 2 for case in cases)


def test_a_flight_judges_twice_at_most_in_its_group_and_no_other_file(everything):
    for group in GROUPS[:-1]:
        judging = [case.held_out for case in make_cases(everything, only=[group])]
        assert len(judging) <= campaign_of(group).most
        assert max(map(judging.count, judging)) <= 2
        assert not any(path.name.startswith(("info", "pid_mell", "LOG")) for path in judging)


def test_all_campaigns_together_are_at_most_sixty_cases():
    high_or_low = sum(
        campaign.most for campaign in CAMPAIGNS if not campaign.group.startswith("swarm-single")
    )
    assert high_or_low <= 62


def test_the_height_of_a_flight_decides_whether_the_ground_is_near(everything):
    high, low = (
        make_cases(everything, only=[f"swarm-{kind}-small"]) for kind in ("single", "ground")
    )
    assert {case.held_out.parent.name for case in high} == {"single"}
    assert {case.held_out.parent.name for case in low} == {"ground"}
    assert all(
        "cf50" in path.name for case in (*high, *low) for path in (*case.train, case.held_out)
    )


def test_cases_are_picked_evenly_from_the_first_to_the_last():
    assert evenly(range(9), 3) == [0, 4, 8]
    assert evenly(range(2), 3) == [0, 1]
    assert evenly([], 3) == []


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
        make_cases(folder, only=["idsia"])
    with pytest.raises(ValueError, match=f"must be of {GROUPS[0]}"):
        make_cases(folder, only=["storm"])


def test_a_neighbour_is_the_other_vehicle_of_the_same_run(folder):
    logs = [folder / f"cf5{vehicle}_02.gz" for vehicle in (0, 1)]
    beside, alone = (campaign_of(f"swarm-downwash{suffix}") for suffix in ("", "-alone"))
    assert [beside.neighbour(path) for path in logs] == logs[::-1]
    assert [alone.neighbour(path) for path in logs] == [None, None]
    assert beside.neighbour(folder / "other_02.gz") is None
