"""Laws of what the causes leave: its size first, then the probability that no effect explains it."""

import dataclasses as dc

from np_drake.diagnosis.report.remainder import calibration_share, gap_rows, remains
from np_drake.diagnosis.residuals.residual_parts import ChannelGap
from np_drake.diagnosis.result import Rung


def with_channels(diagnosis, *channels):
    return dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))


def test_the_size_of_what_is_left_comes_before_its_probability(diagnosis):
    said = remains(diagnosis).replace("\u00a0", " ")
    assert said.startswith("0.2 % of the held-out gap is left: 44 mN and 2.4 mN·m above the noise. Probability")
    assert said.endswith("3 %.")


def test_nothing_is_left_where_the_causes_reach_the_noise(diagnosis):
    closed = (dc.replace(c, after=c.noise_floor) for c in diagnosis.localisation.channels)
    assert remains(with_channels(diagnosis, *closed)).startswith("Nothing above the noise is left")


def test_a_kind_that_had_no_gap_has_none_left(diagnosis):
    quiet = (dc.replace(c, rms=c.noise_floor) if c.unit == "N·m" else c for c in diagnosis.localisation.channels)
    assert "left: 44\u00a0mN above the noise" in remains(with_channels(diagnosis, *quiet))


def test_small_vehicles_have_small_units(diagnosis):
    row, _ = gap_rows(with_channels(diagnosis, ChannelGap("force z", "N", 0.034, 0.0038, 0.0066, 0.97)))
    assert row[:4] == ("vertical force [mN]", "34", "6.6", "3.8")


def test_a_torque_that_the_log_does_not_tell_is_no_part_of_the_gap(diagnosis):
    channels = diagnosis.localisation.channels
    silent = (dc.replace(c, rms=0.0, after=1e-14) if c.unit == "N·m" else c for c in channels)
    names = [row[0] for row in gap_rows(with_channels(diagnosis, *silent))]
    assert names == ["lateral force [N]", "vertical force [N]", "all, over noise [1]"]


def test_calibration_says_what_it_explains_by_itself(diagnosis):
    reduction = diagnosis.gap_reduction
    assert calibration_share(reduction).replace("\u00a0", " ") == "By itself it explains 75 % of the held-out gap."
    worse = dc.replace(reduction, ladder=(Rung("nominal", 9.84), Rung("+ calibration", 12.0)))
    assert calibration_share(worse).endswith("does not help on held-out flights: 9.8 to 12 times the noise.")
    assert calibration_share(dc.replace(reduction, ladder=())) == ""
