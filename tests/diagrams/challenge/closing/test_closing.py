"""Laws of the study of the closed-loop gap."""

import numpy as np
import pytest

from diagrams.challenge.closing.reality import MOST, nominal_reality, withheld_reality
from diagrams.challenge.closing.study import CORRECTED, NOMINAL, REAL, ROWS, gained, table
from diagrams.challenge.generate.composition import compatible
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()


@pytest.mark.parametrize("seed", range(30))
def test_withheld_effects_can_be_told_apart_and_fly(seed):
    reality = withheld_reality(seed, VEHICLE).check()
    names = tuple(entry.effect for entry in reality.effects)
    apart = tuple(n for n in names if n != "linear_drag" or "constant_wind" not in names)
    assert 1 <= len(apart) <= MOST
    assert len(apart) == 1 or compatible(apart)
    assert withheld_reality(seed, VEHICLE) == reality


def test_the_nominal_simulator_has_no_effects():
    reality = nominal_reality()
    assert reality.everything() == []


def result(nominal, corrected, real, foretold_nominal, foretold_corrected):
    return {
        "E_xy": {NOMINAL: nominal, CORRECTED: corrected, REAL: real},
        "foretold": {NOMINAL: foretold_nominal, CORRECTED: foretold_corrected},
    }


def test_gains_are_medians_of_ratios():
    found = gained(
        [result(1.0, 0.5, 0.4, 0.2, 0.45), result(2.0, 0.2, 0.2, 0.2, 0.2), result(1.0, 0.3, 0.3, 0.5, 0.3)]
    )
    assert found["fall"] == pytest.approx(0.7)
    assert found["over_real"] == pytest.approx(1.0)
    assert found["foretold by the nominal simulator"] == pytest.approx(0.8)
    assert found["foretold by the corrected simulator"] == pytest.approx(0.0)


def test_a_lost_vehicle_counts_as_infinitely_bad():
    lost, flown = result(1.0, None, 0.4, 0.2, 0.45), result(1.0, 0.5, 0.5, 0.2, 0.5)
    assert gained([lost])["fall"] == -np.inf
    assert np.isfinite(gained([lost, flown, flown])["fall"])
    assert np.isnan(gained([result(None, 0.5, None, 0.2, 0.45)])["over_real"])


def test_the_table_has_quartiles_of_what_flew_and_counts_what_was_lost():
    results = [{"E_xy": dict.fromkeys(ROWS, value)} for value in (0.1, 0.2, 0.3, None)]
    lines = {line["row"]: line for line in table(results)}
    quartiles = [lines["hold"][key] for key in ("lower", "median", "upper")]
    np.testing.assert_allclose(quartiles, [0.15, 0.2, 0.25])
    assert (lines["hold"]["flown"], lines["hold"]["lost"]) == (3, 1)
    assert lines["oracle"]["lost"] == 0
    assert set(lines) >= {"nominal", "np: nominal simulator", "np: corrected simulator", "np: real flights"}
