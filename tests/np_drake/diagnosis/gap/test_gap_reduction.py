"""Laws of the gap reduction."""

import numpy as np
import pytest

from np_drake.diagnosis import gap as dut
from np_drake.diagnosis.decision.decide import decide
from np_drake.diagnosis.decision.unexplained import LinearModel, measure_remainder
from np_drake.diagnosis.gap import smooth_states
from np_drake.diagnosis.held_out import on_held_out
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.result import ReplayGap
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.rigid_body import P, Q, V

REAL = Options.for_sensors(True)


@pytest.fixture(scope="module")
def solved(ranked):
    case = ranked(MassError(0.2), LinearDrag(0.6, 0.6, 0.6))
    held = on_held_out(case.fit, case.held_out, case.ranking.noise, REAL)
    causes, _ = decide(case.ranking, LinearModel(case.ranking).log_odds(()), held)
    return case, held, causes


def reduction(case, held, causes, replay=None):
    noise = case.ranking.noise
    return dut.measure_gap_reduction(
        causes, noise, held, measure_remainder(causes, noise, held, (), REAL), replay
    )


def test_with_the_true_causes_the_gap_goes_down_to_the_noise(solved):
    case, held, causes = solved
    found = reduction(case, held, causes, None)
    assert found.before > 5.0
    assert found.after == pytest.approx(1.0, abs=0.1)
    assert found.fraction == pytest.approx(1.0, abs=0.02)
    assert found.ci95[0] <= found.fraction <= found.ci95[1]
    assert found.replay_before is None


def test_the_held_out_gain_of_a_cause_is_what_comes_back_without_it(solved):
    case, held, causes = solved
    told = dut.with_held_out_gains(causes, case.ranking.noise, held)
    assert all(0.0 < c.held_out_gain <= 1.01 for c in told)
    (alone,) = dut.with_held_out_gains(causes[:1], case.ranking.noise, held)
    found = reduction(case, held, causes[:1], None)
    assert alone.held_out_gain == pytest.approx(found.fraction, abs=0.02)  # of the calibration


def test_the_replay_gets_the_fitted_effects_and_their_onsets(solved):
    case, held, causes = solved
    calls = []

    def replay(logs, effects):
        calls.append(effects)
        return ReplayGap((0.5,), *(np.zeros((1, 3)) for _ in range(3)), 1)

    reduction(case, held, causes, replay)
    before, after = calls
    assert before == []
    assert {e.identifier for e, _ in after} == {"mass_error", "linear_drag"}
    assert all(onset == {"c": None} for _, onset in after)


RATE = 100.0


@pytest.fixture
def flown():
    """Return (t, x) of ten seconds on a circle of 1 m at 1.5 rad/s, level."""
    t = np.arange(round(10 * RATE)) / RATE
    x = np.zeros((len(t), 13))
    x[:, Q][:, 0] = 1.0
    x[:, P] = np.stack([np.cos(1.5 * t), np.sin(1.5 * t), 1 + 0 * t], axis=1)
    x[:, V] = 1.5 * np.stack([-np.sin(1.5 * t), np.cos(1.5 * t), 0 * t], axis=1)
    return t, x


def velocity_error(smoothed, x):
    """Return the RMS error away from the ends, where parabolas are one-sided [m/s]."""
    return float(np.sqrt(np.mean((smoothed - x)[30:-30, V] ** 2)))


def test_a_velocity_that_wanders_is_mended_by_the_position(flown):
    t, x = flown
    read = x.copy()
    read[:, V] += 0.04 * np.stack([np.sin(2 * t), np.cos(1.3 * t), np.sin(0.7 * t + 1)], axis=1)
    read[:, P] += 0.001 * np.random.default_rng(3).normal(size=(len(t), 3))
    assert velocity_error(read, x) > 0.02
    assert velocity_error(smooth_states(t, read), x) < 0.008


def test_a_constant_offset_of_the_velocity_is_no_noise(flown):
    t, x = flown
    read = x.copy()
    read[:, V] += [0.2, -0.1, 0.05]
    np.testing.assert_allclose(
        smooth_states(t, read)[:, V] - smooth_states(t, x)[:, V], read[:, V] - x[:, V]
    )
