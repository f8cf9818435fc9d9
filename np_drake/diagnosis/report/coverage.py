"""Coverage: which of the causes the held-out flights put to the test."""

from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.localisation.localisation import quantities
from np_drake.diagnosis.report.words import capital, listed, measure, name_of, percent
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.result import Cause
from np_drake.effects.library import effect_of

LEAST = 1 / 3  # of what it is in training, below which nothing is tested [1]; own choice
UPPER = 0.95  # quantile of a quantity that a flight is said to reach [1]
ALSO = {
    "speed": "grows with speed",
    "rate": "grows with body rates",
}  # said of a quantity without a cause

Reach = dict[str, tuple[float, str]]  # by quantity, what flights reach and its unit


def coverage(
    causes: Sequence[Cause], train: Sequence[FlightResiduals], held_out: Sequence[FlightResiduals]
) -> tuple[str, ...]:
    """Return sentences on which causes the held-out flights do not test, or one that they test all.

    A cause is tested where its predicted residual on held-out flights is at least `LEAST` of that
    in training. Rows that joined the fit do not count.
    """
    there, here = reach(train), reach(held_out)
    low = [name for name, (value, _) in there.items() if here[name][0] < LEAST * value]
    traces = {c.identifier: trace_ratio(c.identifier, causes, train, held_out) for c in causes}
    untested = [name for name, ratio in traces.items() if ratio < LEAST]
    out = []
    for quantity in low:
        names = [name for name in untested if effect_of(name).grows_with == quantity]
        tested = any(effect_of(name).grows_with == quantity for name in set(traces) - set(untested))
        if names or (quantity in ALSO and not tested):
            what = listed([name_of(name) for name in names]) if names else f"what {ALSO[quantity]}"
            out.append(_less(here, there, quantity, len(held_out)) + _not_tested(what, len(names)))
    for name in untested:
        if effect_of(name).grows_with not in low:
            out.append(_faint(name, traces[name], len(held_out)))
    return tuple(out) or (_all_tested(traces, len(held_out)),)


def reach(flights: Sequence[FlightResiduals]) -> Reach:
    """Return the speed, body rate and torque that flights reach, and the duration of the
    longest.
    """
    upper: dict[str, tuple[float, str]] = {}
    seen = [(quantities(e), ~e.joined) for e in flights]
    for name in ("speed", "rate"):
        values = np.concatenate([of[name][0][rows] for of, rows in seen])
        upper[name] = float(np.quantile(values, UPPER)), seen[0][0][name][1]
    told = [e.nominal[:, 3:] - e.nominal[:, 3:].mean(axis=0) for e in flights if e.knows_torque]
    torque = (
        np.concatenate(told)[np.concatenate([rows for _, rows in seen])]
        if len(told) == len(seen)
        else 0.0
    )
    upper["torque"] = (
        float(np.quantile(np.linalg.norm(np.atleast_2d(torque), axis=1), UPPER)),
        "N·m",
    )
    upper["duration"] = max(float(np.ptp(e.t[~e.joined])) for e in flights), "s"
    return upper


def trace_ratio(
    identifier: str,
    causes: Sequence[Cause],
    train: Sequence[FlightResiduals],
    held_out: Sequence[FlightResiduals],
) -> float:
    """Return the RMS that a cause predicts on held-out flights over that in training [1].

    The channels of the wrench are divided by the RMS residual in training. Infinite where it
    predicts nothing in training, as gusts do.
    """
    scale = np.sqrt(np.mean(np.concatenate([e.y[:, WRENCH] for e in train]) ** 2, axis=0))
    sizes = [_trace(identifier, causes, flights, scale) for flights in (train, held_out)]
    return sizes[1] / sizes[0] if sizes[0] > 0 else np.inf


def _trace(
    identifier: str, causes: Sequence[Cause], flights: Sequence[FlightResiduals], scale: np.ndarray
) -> float:
    """Return the RMS of what the residual of all causes owes to one, in units of `scale` (6,)."""
    every = [Term(c.effect, c.onset) for c in causes if c.effect is not None]
    others = [term for term in every if term.effect.identifier != identifier]
    parts = [
        (predicted_residual(e, every) - predicted_residual(e, others))[~e.joined] for e in flights
    ]
    own = np.concatenate(parts)[:, WRENCH][:, scale > 0] / scale[scale > 0]
    return float(np.sqrt(np.mean(own**2)))


def _less(here: Mapping, there: Mapping, quantity: str, flights: int) -> str:
    subject = "The held-out flight reaches" if flights == 1 else "The held-out flights reach"
    if quantity == "duration":
        subject = "The held-out flight lasts" if flights == 1 else "The held-out flights last"
    what = " of torque" if quantity == "torque" else ""
    return f"{subject} {measure(*here[quantity])}{what}, training {measure(*there[quantity])}"


def _not_tested(what: str, count: int) -> str:
    return f": {what} {'were' if count > 1 else 'was'} not tested."


def _faint(name: str, ratio: float, flights: int) -> str:
    where = f"the held-out flight{'s' * (flights > 1)}"
    if ratio == 0:
        return f"{capital(name_of(name))} does not act in {where}: it was not tested."
    return (
        f"{capital(name_of(name))} has {percent(ratio)} of its training trace in {where}: it "
        f"was not tested."
    )


def _all_tested(traces: Mapping[str, float], flights: int) -> str:
    subject, end = ("The held-out flight", "s") if flights == 1 else ("The held-out flights", "")
    known = {name: ratio for name, ratio in traces.items() if np.isfinite(ratio)}
    if not known:
        return f"{subject} move{end} like training: what acts there would show."
    weakest = min(known, key=known.__getitem__)
    who = name_of(weakest) if len(known) == 1 else f"the weakest, {name_of(weakest)},"
    return (
        f"{subject} test{end} every cause: {who} has {percent(known[weakest])} of its "
        f"training trace."
    )
