import pytest
from hypothesis import given
from hypothesis import strategies as st

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.selection.calibration import calibrated_probability

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
THRESHOLDS = REAL.thresholds

SHARE = st.floats(0.0, 1.0)


@given(SHARE, SHARE)
def test_a_probability_grows_with_the_evidence_and_is_never_quite_sure(a, b):
    low, high = (
        calibrated_probability({"x": share}, ("x",), thresholds=THRESHOLDS) for share in sorted((a, b))
    )
    assert 0.0 <= low <= high <= THRESHOLDS.trust


@given(SHARE.filter(lambda s: s <= 0.5), SHARE.filter(lambda s: s <= 0.5))
def test_what_cannot_be_told_apart_counts_together(a, b):
    assert calibrated_probability({"x": a, "y": b}, ("x", "y"), thresholds=THRESHOLDS) == pytest.approx(
        calibrated_probability({"z": a + b}, ("z",), thresholds=THRESHOLDS)
    )


def test_even_odds_stay_even_but_for_what_the_library_lacks():
    assert calibrated_probability({"x": 0.5}, ("x",), thresholds=THRESHOLDS) == pytest.approx(
        0.5 * THRESHOLDS.trust
    )
    assert calibrated_probability({}, ("x",), thresholds=THRESHOLDS) == 0.0
