"""The residuals of one flight with noise and without, and the onset that they tell."""

import dataclasses as dc
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from diagrams.challenge.generate.case import Case
from diagrams.challenge.generate.logged_input import best_known
from np_drake.diagnosis.forward_model import Term, gate, predicted_residual
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.flight_log import FlightLog

AROUND = 4.0  # of the true onset, in which others are weighed [s]
SPAN = 0.4  # that is to hold the onset as likely as may be: twice the tolerance of the score [s]


def best_onset(
    exact: FlightResiduals,
    errors: np.ndarray,
    terms: Sequence[Term],
    onset: float,
    noise: NoiseModel,
) -> float:
    """Return the middle of the span of `SPAN` that most likely holds the onset [s], under a uniform
    prior about it.

    Args:
        errors: (m, 15) what noise adds to its channels.
        onset: the true one [s].
        noise: model of `errors`.
    """
    t, name = exact.t, exact.name
    begun = left_by(exact, terms)
    always = left_by(exact, [dc.replace(term, onset={**term.onset, name: None}) for term in terms])
    tried = np.flatnonzero(np.abs(t - onset) <= AROUND)
    # Left if it began at k: as it is where it has begun, as from the start before that.
    acting = np.where(gate(t, onset) > 0, begun, always)
    cost = [
        float(np.sum(noise.whiten(errors + begun - gate(t, k) * acting) ** 2)) for k in t[tried]
    ]
    # Posterior of the onset on a grid: Gaussian likelihood of the whitened residual, normalised by
    # its largest value.
    likely = np.exp(-0.5 * (np.array(cost) - min(cost)))
    width = min(len(likely), max(1, round(SPAN / exact.grid.step)))
    first = int(np.argmax(np.convolve(likely, np.ones(width), "valid")))
    within = np.cumsum(likely[first : first + width])
    return float(t[tried[first + np.searchsorted(within, 0.5 * within[-1])]])


def left_by(flight: FlightResiduals, terms: Sequence[Term]) -> np.ndarray:
    """Return what terms leave (m, 15), in the channels that the log tells."""
    return flight.known(predicted_residual(flight, terms))


@dc.dataclass(frozen=True)
class FlightPair:
    """The residuals of one flight as measured, and without noise on the same grid."""

    measured: FlightResiduals
    true: FlightResiduals

    @classmethod
    def of(cls, case: Case, file: str, exact: FlightLog, noisy: FlightLog) -> "FlightPair":
        """Return the pair of one flight; both begin where the measured one counts, and know when
        commands act.
        """
        measured, true = (
            best_known(dc.replace(log, name=file), exact.u, case.vehicle, case.input.kind)
            for log in (noisy, exact)
        )
        first = make_flight_residuals(measured, case.vehicle)
        return cls(first, make_flight_residuals(true, case.vehicle, since=float(first.t[0])))

    @property
    def errors(self) -> np.ndarray:
        """Return what noise leaves to the true model (m, 15)."""
        return self.measured.y - self.true.y

    @cached_property
    def noise(self) -> np.ndarray:
        """Return the RMS (15,) that noise leaves to the true model."""
        return np.sqrt(np.mean(self.errors**2, axis=0))
