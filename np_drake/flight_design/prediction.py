"""What a flight would tell of the explanations that stand, from the columns of the diagnosis' own
residual model.
"""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.diagnosis.calibration import flight_errors
from np_drake.diagnosis.fitting import Free, free_parameters, scaled_jacobian
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.numerics import Readings
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.effects.explanation import CALIBRATION, Explanation
from np_drake.flight_design.information import Information, square_root
from np_drake.flight_log import FlightLog
from np_drake.references.flatness import targets
from np_drake.rigid_body import P, Q, V, W
from np_drake.vehicle import Vehicle

HALF_WIDTH = 1.96  # of an interval of 95 % over the standard deviation [1]
NAME = "next"  # of the flight


@dc.dataclass(frozen=True)
class Expected:
    """Residual that an explanation expects in a flight, and how far its parameters move that.

    mean: (m, 15) predicted residual.
    spread: (m, 15, k) its change by each of k independent standard normal deviations z of
        parameters and hidden states.
    names: (p,) of the parameters.
    root: (p, p) their change by the first p of z, in SI.
    """

    mean: np.ndarray
    spread: np.ndarray
    names: tuple[str, ...]
    root: np.ndarray

    def intervals(self, covariance: np.ndarray) -> dict[str, tuple[float, float]]:
        """Return half-widths of 95 % intervals of each parameter, before and after a flight, by
        name [SI].

        Args: covariance: (k, k) of z after the flight.
        """
        p = len(self.names)
        before = np.sqrt(np.sum(self.root**2, axis=1))
        after = np.sqrt(np.einsum("ij,jk,ik->i", self.root, covariance[:p, :p], self.root))
        pairs = zip((HALF_WIDTH * before).tolist(), (HALF_WIDTH * after).tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))


@dc.dataclass(frozen=True)
class Prediction:
    """What a flight tells.

    information: about the explanations.   intervals: of each explanation, `Expected.intervals`.
    seen: (K,) products of the whitened columns with the readings of the flight, for
        `Information.log_posterior`.
    """

    information: Information
    intervals: tuple[dict[str, tuple[float, float]], ...]
    seen: np.ndarray


def nominal_residuals(
    vehicle: Vehicle, t: np.ndarray, flat: np.ndarray, *, accelerations: bool = True
) -> FlightResiduals:
    """Return the residuals of the nominal vehicle that follows a motion exactly; their regressors
    are what counts.

    Source: differential flatness of eq. (1) gives state and command
    (`references.flatness.targets`).

    Args:
        t: (m,) equally spaced times of the rows [s].
        flat: (5, m, 3) position and its four derivatives in W at these times.
    """
    x, u = targets(vehicle, flat, np.zeros((len(t), 6)))
    a = flat[2] if accelerations else None
    log = FlightLog(t=t, p=x[:, P], q=x[:, Q], v=x[:, V], w=x[:, W], u=u, a=a, name=NAME)
    return make_flight_residuals(log, vehicle, float(t[1] - t[0]), since=float(t[0]))


def predict(
    flight: FlightResiduals, explanations: Sequence[Explanation], readings: Readings
) -> Prediction:
    """Return what a flight tells about the explanations.

    Args:
        explanations: that stand, each linear about its values, with its posterior as the prior of
            the flight.
        readings: noise that whitens, and tolerances of the sensors, whose errors are new in every
            flight.
    """
    options = Options.for_sensors(readings.tolerance.real, readings.tolerance)
    expected = [expected_residual(flight, explanation, options) for explanation in explanations]
    drift = flight_errors([flight], readings.tolerance)
    drifting = np.zeros((*flight.y.shape, 0)) if not drift else drift[0].columns[flight.name]
    columns = [*(e.mean[..., None] for e in expected), *(e.spread for e in expected), drifting]
    # Inner products of the whitened columns; the last row and column are those of the readings.
    gram = readings.noise.products(
        [flight.bridged(X) for X in (*columns, flight.y[..., None])], flight.name
    )
    gram = gram / options.priors.temperature
    sizes = tuple(e.spread.shape[-1] for e in expected)
    prior = np.array([e.probability for e in explanations])
    information = Information(gram[:-1, :-1], sizes, prior / prior.sum())
    intervals = tuple(e.intervals(information.posterior(i)) for i, e in enumerate(expected))
    return Prediction(information, intervals, gram[:-1, -1])


def expected_residual(
    flight: FlightResiduals, explanation: Explanation, options: Options
) -> Expected:
    """Return the residual that an explanation expects in a flight.

    Args:
        flight: residuals of the flight, of which motion and commands count.
    """
    terms = [Term(effect) for effect in (*explanation.effects, *explanation.calibration)]
    free = free_parameters(terms, [flight], {}, options.priors)
    names = [_name(f, terms, len(explanation.effects)) for f in free]
    deviation = np.sqrt(np.maximum(np.diag(explanation.covariance), 1e-300))
    known = {name: k for k, name in enumerate(explanation.parameters)}
    own = [
        dc.replace(f, scale=float(deviation[known[name]]))
        for f, name in zip(free, names, strict=True)
        if name in known
    ]
    hidden = [f for f in free if f.flight]
    J = scaled_jacobian(terms, [*own, *hidden], flight)
    listed = tuple(name for name in names if name in known)
    order = [known[name] for name in listed]
    # Correlated parameters as a linear map of independent ones, correlation = root root^T.
    root = square_root(
        (explanation.covariance / np.outer(deviation, deviation))[np.ix_(order, order)]
    )
    spread = np.concatenate([J[..., : len(own)] @ root, J[..., len(own) :]], axis=-1)
    return Expected(
        predicted_residual(flight, terms), spread, listed, deviation[order][:, None] * root
    )


def _name(f: Free, terms: Sequence[Term], effects: int) -> str:
    """Return the name of a free parameter as an explanation has it; empty for a hidden state."""
    if f.flight:
        return ""
    return f"{CALIBRATION if f.term >= effects else ''}{terms[f.term].effect.identifier}.{f.name}"
