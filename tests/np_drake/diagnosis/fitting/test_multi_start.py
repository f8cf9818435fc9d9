"""Laws of multi-start fits."""

import dataclasses as dc

import pytest

from np_drake.diagnosis.fitting import first_fit, refit, restart
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.numerics import fit_noise
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Guess, Model, RegressionProblem, payload_about
from np_drake.effects.suspended_payload import SuspendedPayload

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
PRIORS = REAL.priors

PAYLOAD = SuspendedPayload(0.25, 1.2)
ONLY = Model((0,), 0.0)


@pytest.fixture(scope="module")
def swinging(seen):
    """Return two flights with a payload of guessed length, and a noise model of their whole
    residual.

    That noise resonates with the swing.
    """
    flights = [seen(PAYLOAD, name=str(i), seed=i, noise=1.0, seconds=10.0) for i in (1, 2)]
    noise = fit_noise([e.y for e in flights], flights[0].grid.step)
    return RegressionProblem(
        flights,
        noise,
        [],
        [payload_about(flights, Guess(1.15), priors=PRIORS).candidate(flights)],
        temperature=2.0,
        options=REAL,
    )


def mass(fit) -> float:
    return fit.terms[0].effect.payload.mass


def test_the_first_fit_passes_noise_that_rings_with_an_unmet_swing(swinging):
    first = first_fit(swinging, ONLY, iterations=3)
    bent = refit(swinging, ONLY, None, iterations=3)
    assert mass(first) == pytest.approx(PAYLOAD.mass, rel=0.01)
    assert first.terms[0].effect.payload.length == pytest.approx(PAYLOAD.length, rel=0.01)
    assert abs(mass(bent) - PAYLOAD.mass) > 3 * abs(mass(first) - PAYLOAD.mass)


@pytest.mark.parametrize("lost", [False, True])
def test_from_a_known_fit_or_from_the_posterior_whichever_leads_farther(swinging, lost):
    known = first_fit(swinging, ONLY, iterations=3)
    noise = fit_noise([known.residual(e) for e in swinging.flights], swinging.noise.step)
    if lost:  # another length, and at rest
        known = dc.replace(known, terms=(Term(SuspendedPayload(0.05, 2.4)),))
    again = refit(swinging, ONLY, known, noise)
    assert mass(again) == pytest.approx(PAYLOAD.mass, rel=0.01)
    assert mass(restart(swinging, ONLY, again, noise)) == pytest.approx(PAYLOAD.mass, rel=0.01)
    posterior = refit(swinging, ONLY, None, noise, iterations=1)
    known_first = refit(swinging, ONLY, known, noise, iterations=1)
    assert (known_first.log_evidence > posterior.log_evidence + 1.0) is not lost
