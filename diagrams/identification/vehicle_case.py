"""A simulated vehicle, identified: what is told of each quantity, beside the truth and two naive
answers.
"""

import dataclasses as dc
import time
from typing import Any

import numpy as np

from diagrams.batch.campaign import Case
from diagrams.identification.simulated import ATTEMPTS, INPUTS, Truth, draw_and_fly, draw_truth
from np_drake.identification.identify import identify
from np_drake.identification.model import Values
from np_drake.identification.quantities import Basis, Identified, Quantity
from np_drake.identification.validation import USUAL, plain_least_squares

SHARE, TIME, PLACE, PLAIN = "%", "ms", "mm per 10 cm arm", "own unit"  # units of errors
SMALL = 1e-6  # move of a parameter that shows whether a quantity depends on it [1]


def make_cases(vehicles: int, seed: int) -> list[Case]:
    """Return the cases: a seed each, the kinds of input in turn."""
    return [
        {"seed": seed + number, "kind": INPUTS[number % len(INPUTS)]} for number in range(vehicles)
    ]


@dc.dataclass(frozen=True)
class VehicleCase:
    """Work of a case: draw a vehicle, fly it so often and so long [s], identify it."""

    flights: int
    seconds: float

    def __call__(self, case: Case) -> dict[str, Any]:
        """Return what was told, and processor time of the identification alone [s].

        Raises: FailedRun: if no vehicle of this seed can be flown.
        """
        truth, logs = draw_and_fly(case["seed"], case["kind"], self.flights, self.seconds)
        start = time.process_time()
        found = identify(logs, truth.known, mass=truth.vehicle.mass)
        quantities = found.quantities
        spent = time.process_time() - start
        known = truth.quantities(found.basis.frame.volts)
        plain = plain_least_squares(found)
        return {
            "mass": truth.vehicle.mass,
            "refused": refused_draws(case["seed"], truth),
            "processor_time": spent,
            "quantities": [
                _beside_truth(q, known[q.name], truth, found.basis, plain)
                for q in quantities
                if q.name in known
            ],
        }


def refused_draws(seed: int, truth: Truth) -> int:
    """Return how many vehicles were drawn before the one that its controller flies."""
    for attempt in range(ATTEMPTS):
        drawn = draw_truth(np.random.default_rng((seed, attempt)), truth.input)
        if drawn.vehicle.mass == truth.vehicle.mass:
            return attempt
    raise ValueError(
        f"identification: vehicle of {truth.vehicle.mass:g} kg is none of seed {seed}."
    )


def _beside_truth(
    q: Identified, true: float, truth: Truth, basis: Basis, plain: Values
) -> dict[str, Any]:
    low, high = q.prior
    guess = float(np.sqrt(low * high)) if q.quantity.positive else 0.5 * (low + high)
    naive = q.quantity.of(plain, basis) if _moves(q.quantity, basis, plain) else None
    unit, error = error_of(q.quantity, q.value, true, truth)
    return {
        "name": q.name,
        "air": "velocity" in q.quantity.needs,
        "unit": unit,
        "told": q.told,
        "within": bool(q.low <= true <= q.high),
        "value": q.value,
        "ci95": [q.low, q.high],
        "true": true,
        "error": error,
        "prior_error": error_of(q.quantity, guess, true, truth)[1],
        "plain_error": None if naive is None else error_of(q.quantity, naive, true, truth)[1],
    }


def _moves(quantity: Quantity, basis: Basis, values: Values) -> bool:
    """Return whether plain least squares moves a quantity."""
    here = quantity.of(values, basis)
    moved = values | {name: values[name] * (1 + SMALL) + SMALL for name in USUAL if name in values}
    return quantity.of(moved, basis) != here


def error_of(quantity: Quantity, value: float, true: float, truth: Truth) -> tuple[str, float]:
    """Return the unit in which a quantity is judged, and the error.

    A share of the truth where the quantity is positive, of the inertia it belongs to where it is a
    product of inertia.
    """
    off = abs(value - true)
    if quantity.unit == "s":
        return TIME, 1e3 * off
    if quantity.positive and value > 0.0:
        return SHARE, 100.0 * abs(float(np.log(value / true)))
    if quantity.unit == "kg·m²":
        return SHARE, 100.0 * off / float(np.mean(np.diag(truth.vehicle.J)[:2]))
    if quantity.unit == "m":
        arms = np.linalg.norm(np.array(truth.vehicle.rotor_positions)[:, :2], axis=1)
        return PLACE, 100.0 * off / float(arms.mean())
    return PLAIN, off
