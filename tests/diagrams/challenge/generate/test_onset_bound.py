import numpy as np
import pytest

from diagrams.challenge.generate.onset_bound import AROUND, best_onset
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.numerics.autoregressive_noise import fit_noise
from np_drake.diagnosis.residuals.flight_residuals import make_flight_residuals
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.logs.flight_log import FlightLog

ONSET = 7.0


@pytest.fixture(scope="module")
def hovering(vehicle):
    """Twelve seconds at rest under the thrust that holds the weight, as evidence."""
    t = np.arange(1200) / 100
    rest = np.zeros((len(t), 3))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    u = np.tile([vehicle.mass * vehicle.gravity, 0.0, 0.0, 0.0], (len(t), 1))
    log = FlightLog(t, rest, q, rest, rest, u, a=rest, al=rest, name="hover")
    return make_flight_residuals(log, vehicle)


def told(evidence, strength, seed=1):
    rng = np.random.default_rng(seed)
    errors = 0.05 * rng.standard_normal(evidence.y.shape)
    terms = [Term(ThrustScale(1 - strength), {evidence.name: ONSET})]
    return best_onset(evidence, errors, terms, ONSET, fit_noise([errors], evidence.grid.step))


def test_what_is_plain_to_see_is_told_to_a_few_rows(hovering):
    assert told(hovering, 0.05) == pytest.approx(ONSET, abs=0.05)


def test_what_noise_hides_is_told_by_nobody(hovering):
    errors = [abs(told(hovering, 1e-4, seed) - ONSET) for seed in range(6)]
    assert np.median(errors) > 0.2
    assert max(errors) <= AROUND


def test_its_error_falls_with_the_strength(hovering):
    faint, plain = (
        np.mean([abs(told(hovering, strength, seed) - ONSET) for seed in range(6)])
        for strength in (1e-3, 2e-2)
    )
    assert plain < 0.5 * faint
