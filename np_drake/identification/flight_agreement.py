"""Flights that tell something else of a vehicle than the others.

Source: DerSimonian and Laird 1986 (variance between studies).
"""

import dataclasses as dc
from collections.abc import Callable

import numpy as np
import scipy

from np_drake.estimation.map_fit import Agreement, random_effect
from np_drake.identification.identify import Identification
from np_drake.identification.model import Values
from np_drake.identification.quantities import OBSERVABLE_RATIO, Z_975, Basis, Identified, Quantity

DIFFER = 0.01  # probability below which flights differ by more than chance [1]; own choice


@dc.dataclass(frozen=True)
class FlightValues:
    """What each flight tells alone of one quantity.

    quantity: as all flights together tell it.
    names: (f,) of the flights.
    value, low, high: (f,) with 95 % intervals; NaN where a flight tells nothing.
    apart: names of flights that stand out.
    """

    quantity: Identified
    names: tuple[str, ...]
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    apart: tuple[str, ...] = ()

    @property
    def differ(self) -> bool:
        """Whether the flights differ by more than chance."""
        return self.quantity.p < DIFFER

    @property
    def text(self) -> str:
        """That flights differ, in a sentence without its full stop, and which stand out."""
        sentence = f"{self.quantity.title}: flights differ"
        one = len(self.apart) == 1
        if not self.apart or len(self.names) - len(self.apart) < 2:
            return sentence
        return f"{sentence}; {', '.join(self.apart)} {'stands' if one else 'stand'} out"


def flight_values(identification: Identification) -> list[FlightValues]:
    """Return what flights tell alone of each quantity that they tell; one quantity for each
    parameter of the model.
    """
    estimate = identification.estimate
    shown = []
    seen: set[str] = set()
    for quantity in identification.quantities:
        name = quantity.follows
        if not quantity.observable or name in seen or name not in estimate.agreement:
            continue
        seen.add(name)
        place = estimate.layout.names.index(name)

        def of(coordinate: float, quantity=quantity, place=place) -> float:
            z = estimate.z.copy()
            z[place] = coordinate
            return quantity.quantity.of(estimate.layout.values(z), identification.basis)

        shown.append(_shown(identification, quantity, estimate.agreement[name], of))
    return shown


def _shown(
    identification: Identification,
    quantity: Identified,
    agreement: Agreement,
    of: Callable[[float], float],
) -> FlightValues:
    """Return what the flights tell of a quantity, which is `of` a coordinate of z."""
    value, *both = (
        np.array(
            [
                of(c) if np.isfinite(c) else np.nan
                for c in agreement.values + k * Z_975 * agreement.sd
            ]
        )
        for k in (0, -1, 1)
    )
    names = tuple(model.flight.name for model in identification.models)
    apart = tuple(names[i] for i in outlying(agreement)) if quantity.p < DIFFER else ()
    return FlightValues(quantity, names, value, np.minimum(*both), np.maximum(*both), apart)


# What each flight has of its own, by parameter: name, unit, and value from that of the parameter
# and the mean arm [m].
PER_FLIGHT: dict[str, tuple[str, str, Callable[[float, float], float]]] = {
    "charge": ("thrust of a flight", "1", lambda value, arm: value),
    "shift_x": ("centre of mass x of a flight", "m", lambda value, arm: arm * value),
    "shift_y": ("centre of mass y of a flight", "m", lambda value, arm: arm * value),
    "shift_yaw": ("yaw trim of a flight", "1", lambda value, arm: value),
    "clock": ("clock of a flight", "s", lambda value, arm: -value),
    "heading": ("heading of a flight", "rad", lambda value, arm: value),
}


def own_values(identification: Identification) -> list[FlightValues]:
    """Return what each of several flights has of its own, with the interval of its difference to
    their mean.

    Innovations count as white, for the covariance of the estimate holds the spread that is tested
    here.
    """
    e = identification.estimate
    layout = identification.estimate.layout
    covariance = np.linalg.inv(e.information + np.eye(layout.size))
    count = layout.flights
    arm = identification.basis.frame.arm
    shown = []
    for number, parameter in enumerate(layout.per_flight):
        if parameter.name not in PER_FLIGHT or count < 2:
            continue
        places = len(layout.shared) + number + len(layout.per_flight) * np.arange(count)
        contrast = np.eye(count) - 1.0 / count
        sd = np.sqrt(np.diag(contrast @ covariance[np.ix_(places, places)] @ contrast.T))
        if not (sd < OBSERVABLE_RATIO).all():
            continue
        z = e.z[places]
        # Deviations from the mean of n flights have n - 1 degrees of freedom.
        Q = float(np.sum(((z - z.mean()) / sd) ** 2)) * (count - 1) / count
        name, unit, of = PER_FLIGHT[parameter.name]

        def value(z: float, parameter=parameter, of=of) -> float:
            return of(parameter.value(z), arm)

        mean, *ends = (value(c) for c in (float(z.mean()), -Z_975, Z_975))
        p = float(scipy.stats.chi2.sf(Q, count - 1))
        constant = Quantity(name, "", unit, _constant(mean))
        quantity = Identified(constant, mean, mean, mean, (min(ends), max(ends)), True, p)
        shown.append(_shown(identification, quantity, Agreement(z, sd, 0.0, p), value))
    return shown


def outlying(agreement: Agreement) -> list[int]:
    """Return the places of flights that differ from the mean of the others by more than these do
    among themselves.

    The level is shared by all flights (Bonferroni).
    """
    here = np.flatnonzero(np.isfinite(agreement.values))
    outliers = []
    for i in here:
        others = here[here != i]
        if len(others) < 2:
            continue
        values = agreement.values[others]
        sd = agreement.sd[others]
        between, _ = random_effect(values, sd)
        weight = 1.0 / (sd**2 + between)
        mean = weight @ values / weight.sum()
        spread = np.sqrt(agreement.sd[i] ** 2 + 1.0 / weight.sum() + between)
        p = 2.0 * scipy.stats.t.sf(
            abs(agreement.values[i] - mean) / spread, len(others) - 1 if between > 0 else np.inf
        )
        if p < DIFFER / len(here):
            outliers.append(int(i))
    return outliers


def _constant(value: float) -> Callable[[Values, Basis], float]:
    """Return a quantity that has this value whatever the parameters are."""
    return lambda v, b: value
