"""Laws of the names of flights: a block is a run of numbers, and a setting of the fans is a
speed.
"""

from pathlib import Path

import pytest

from diagrams.challenge.real.flight_names import block_name, label, numbered_blocks, wind_speed

BLOCKS = (range(6, 11), range(17, 22), (43, 45, 46), range(57, 62))


def paths(numbers, stem="flight") -> list[Path]:
    return [Path(f"{stem}{n:02}") for n in numbers]


def test_a_block_is_of_consecutive_numbers_with_at_most_one_missing():
    blocks = numbered_blocks(reversed([path for block in BLOCKS for path in paths(block)]))
    assert [block_name(block) for block in blocks] == ["06-10", "17-21", "43-46", "57-61"]


def test_a_block_has_one_stem_and_a_flight_has_a_number():
    found = numbered_blocks([*paths([1, 2]), *paths([3], "other"), Path("README")])
    assert [len(block) for block in found] == [2, 1]


@pytest.mark.parametrize(
    "setting, speed",
    [("nowind", 0.0), ("35wind", 4.2), ("70wind", 8.5), ("100wind", 12.1), ("70p20sint", 8.5)],
)
def test_the_speed_of_the_wind_is_in_proportion_to_the_fans(setting, speed):
    assert wind_speed(setting) == pytest.approx(speed, abs=0.05)  # m/s, as the data set rounds


def test_a_log_is_called_without_what_all_names_have():
    assert label(Path("dataset_B5_helix_rep1.csv.gz")) == "B5_helix_rep1"
    assert label(Path("melon_run2.parquet")) == "melon_run2"
