"""Laws of what the causes leave: its size first, then the probability that no effect explains
it.
"""

import dataclasses as dc

from np_drake.diagnosis.report.answer import gap_rows, remains


def with_channels(diagnosis, *channels):
    return dc.replace(diagnosis, localisation=dc.replace(diagnosis.localisation, channels=channels))


def with_left(diagnosis, **changes):
    left = dc.replace(diagnosis.gap_reduction.left, **changes)
    return dc.replace(diagnosis, gap_reduction=dc.replace(diagnosis.gap_reduction, left=left))


def test_of_an_immaterial_gap_no_share_is_said(diagnosis):
    said = remains(with_left(diagnosis, share=float("nan"), position_before=0.011))
    assert (
        said.replace("\u00a0", " ")
        == "The held-out gap is immaterial: 1.1 cm after 1 s, beyond the noise."
    )


def test_a_torque_that_the_log_does_not_tell_is_no_part_of_the_gap(diagnosis):
    channels = diagnosis.localisation.channels
    silent = (dc.replace(c, rms=0.0, after=1e-14) if c.unit == "N·m" else c for c in channels)
    names = [row[0] for row in gap_rows(with_channels(diagnosis, *silent))]
    assert names == ["lateral force [N]", "vertical force [N]", "all, over noise [1]"]
