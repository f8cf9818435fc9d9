"""Answer of a diagnosis in words: headline, causes, calibration, coverage and remainder."""

from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.localisation import manoeuvre, quantities
from np_drake.diagnosis.report.words import (
    bare_name,
    capital,
    estimate,
    flights,
    listed,
    name_of,
    onset,
    percent_interval,
    phrase,
    plain_name,
    spread,
    unit_of,
)
from np_drake.diagnosis.residuals import WRENCH, FlightResiduals
from np_drake.diagnosis.result import (
    UNKNOWN,
    Cause,
    Diagnosis,
    Finding,
    GapReduction,
    Remainder,
    gap_kinds,
)
from np_drake.effects.library import effect_of
from np_drake.files.number_text import (
    NBSP,
    NOTHING,
    measure,
    number,
    of_at_least,
    percent,
    probability,
    suited,
)

GAP_HEADER = ["held-out residual, RMS", "nominal", "with causes", "noise", "left"]


def gap_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (kind, before, after, noise, left) of each kind of gap, and of all channels in noise
    units.
    """
    rows = []
    for part in gap_kinds(diagnosis.localisation.channels):
        factor, unit = suited(part.before, part.unit)
        sizes = [number(factor * value, 2) for value in (part.before, part.after, part.noise)]
        rows.append((f"{part.kind} [{unit}]", *sizes, percent(part.left)))
    total = diagnosis.gap_reduction
    sizes = [number(value, 2) for value in (total.before, total.after, total.floor)]
    bounds = (1 - total.ci95[1], 1 - total.ci95[0])
    share = (
        f"{percent(share_left(total))} ({percent_interval(bounds)})" if total.material else NOTHING
    )
    return [*rows, ("all, over noise [1]", *sizes, share)]


def share_left(reduction: GapReduction) -> float:
    """Return the share of the held-out gap that causes and calibration leave [1]."""
    return max(reduction.left.share, 0.0)


def sizes_left(left: Remainder) -> str:
    """Return the remainder's force, torque and position error, as in '1.5 mN, 20 µN·m and 3 cm
    after 1 s'.
    """
    sizes = [
        measure(size, unit) for size, unit in ((left.force, "N"), (left.torque, "N·m")) if size > 0
    ]
    return listed([*sizes, f"{measure(left.position, 'm')} after 1{NBSP}s"])


def remains(diagnosis: Diagnosis) -> str:
    """Return how much of the held-out gap is left, and the probability that it is material."""
    left = diagnosis.gap_reduction.left
    if not diagnosis.gap_reduction.material:
        return (
            f"The held-out gap is immaterial: {measure(left.position_before, 'm')} after "
            f"1{NBSP}s, beyond the noise."
        )
    said = (
        f"{percent(share_left(diagnosis.gap_reduction))} of the held-out gap is left beyond "
        f"the noise"
    )
    return (
        f"{said}: {sizes_left(left)}. Probability that this is material: "
        f"{probability(left.probability)}."
    )


def calibration_share(reduction: GapReduction) -> str:
    """Return how much of the held-out gap the calibration of the vehicle explains by itself, in a
    sentence.
    """
    after = {rung.name: rung.residual for rung in reduction.ladder}.get("+ calibration")
    if after is None or not reduction.material:
        return ""
    before, floor = reduction.before, reduction.floor
    share = 1 - (after**2 - floor**2) / (before**2 - floor**2)
    if share >= 0:
        return f"By itself it explains {percent(min(share, 1.0))} of the held-out gap."
    return (
        f"By itself it does not help on held-out flights: {number(before, 2)} to "
        f"{number(after, 2)} times the noise."
    )


CONTRADICTED = -0.02  # held-out gain below which flights contradict a cause [1]; own choice
MOST_NAMED = 3  # causes in the headline; the table has all
PLAIN_GAIN = 1.1  # ratio of errors of the replay from which it is better or worse [1]; own choice


def headline(diagnosis: Diagnosis) -> str:
    """Return the answer in one sentence: the causes, their share of the whole gap, and what the
    replay makes of it.

    At most `MOST_NAMED` causes are named, those with the largest share of the gap. Where the
    held-out flights show no material gap, that is the answer, and nothing is named.
    """
    if diagnosis.cannot_tell:
        return "These logs cannot tell"
    reduction, judges = diagnosis.gap_reduction, _judges(diagnosis)
    if not reduction.material:
        return f"There is no material gap on {judges}"
    causes = named_causes(diagnosis)
    if causes:
        return capital(_explained(diagnosis, causes)) + _unknown(diagnosis)
    sizes = sizes_left(reduction.left)
    if UNKNOWN in diagnosis.verdict:
        return (
            f"No effect explains what is left on {judges} "
            f"({probability(diagnosis.unknown_probability)}): {sizes}"
        )
    calibrated = "with calibration, " if diagnosis.calibration else ""
    return f"Nothing material is missing: {calibrated}the remainder on {judges} is {sizes}"


def _unknown(diagnosis: Diagnosis) -> str:
    """Return what is left that no effect explains, where that is probably material."""
    if UNKNOWN not in diagnosis.verdict:
        return ""
    left, reduction = diagnosis.gap_reduction.left, diagnosis.gap_reduction
    told = f"probability that it is material {probability(left.probability)}"
    return f"; {percent(share_left(reduction))} remains unexplained: {sizes_left(left)} ({told})"


def _explained(diagnosis: Diagnosis, causes: Sequence[Cause]) -> str:
    """Return the causes as subject, what flights contradict, the share of the gap, and whether the
    replay improves.
    """
    names = [phrase(cause) for cause in causes[:MOST_NAMED]]
    rest = len(causes) - len(names)
    names += [f"{rest} more"] * (rest > 0) + ["calibration"] * bool(diagnosis.calibration)
    one, share, judges = len(names) == 1, diagnosis.gap_reduction.fraction, _judges(diagnosis)
    if share < 0:
        return f"{listed(names)} {'does' if one else 'do'} not help: the gap on {judges} grows"
    text = f"{listed(names)} explain{'s' if one else ''} {percent(share)} of the gap on {judges}"
    against = [bare_name(c.identifier) for c in causes if c.held_out_gain < CONTRADICTED]
    if against:
        text += (
            f", which {'is' if len(diagnosis.held_out) == 1 else 'are'} predicted better "
            f"without {listed(against)}"
        )
    if grown := [part.kind for part in gap_kinds(diagnosis.localisation.channels) if part.grows]:
        text += f" and make{'s' * one} {listed(grown)} worse"
    return text + _replayed(diagnosis.gap_reduction)


def _replayed(reduction: GapReduction) -> str:
    """Return how the position error of the replay changes at its last horizon; empty where it was
    not made.
    """
    before, after = reduction.replay_before, reduction.replay_after
    if before is None or after is None:
        return ""
    was, now = float(before.position[-1, 0]), float(after.position[-1, 0])
    horizon = f"after {before.horizon[-1]:g}{NBSP}s"
    if not np.isfinite(now):
        return f"; the corrected simulator loses the vehicle {horizon}"
    if not np.isfinite(was):
        return f"; the replay, lost until now, is off by {measure(now, 'm')} {horizon}"
    if now < was / PLAIN_GAIN:
        return f"; the replay improves from {measure(was, 'm')} to {measure(now, 'm')} {horizon}"
    worse = "gets worse" if now > PLAIN_GAIN * was else "does not improve"
    return f"; the replay {worse} ({measure(was, 'm')} to {measure(now, 'm')} {horizon})"


def _judges(diagnosis: Diagnosis) -> str:
    return f"{'the second half of ' if diagnosis.joined else ''}{flights(len(diagnosis.held_out))}"


def lead(diagnosis: Diagnosis) -> str:
    """Return what stands below the headline: probabilities, what remains, and what the second
    answer adds.
    """
    reduction, said = diagnosis.gap_reduction, []
    if diagnosis.cannot_tell:
        return "The training flights excite too little to tell one effect from another."
    causes, gap = named_causes(diagnosis), reduction.material
    if causes and gap:
        least = min(cause.probability for cause in causes)
        one = f"probability {probability(least)}"
        said.append(one if len(causes) == 1 else f"each has a probability {of_at_least(least)}")
    elif causes:
        them = listed([bare_name(c.identifier) for c in causes])
        said.append(f"training names {them}, which these flights do not need")
    elif UNKNOWN not in diagnosis.verdict:
        said.append("the simulator agrees with the logs, and nothing is named")
    if UNKNOWN in diagnosis.verdict:
        traces = diagnosis.unexplained
        said.append(
            f"to find what remains: {main_remainder(traces).measurement}"
            if traces
            else "it has no trace of its own"
        )
    if diagnosis.new_on_held_out:
        said.append(f"new on {_judges(diagnosis)}: {diagnosis.new_on_held_out[0].text.rstrip('.')}")
    if diagnosis.refit is not None and diagnosis.refit.verdict != diagnosis.verdict:
        said.append(
            "a second answer, which knows halves of the held-out flights, differs: see below"
        )
    return capital("; ".join(said)) + "."


def main_remainder(remains: Sequence[Finding]) -> Finding:
    """Return the finding with the largest share of weight, else with the largest force, else the
    first.
    """
    return max(remains, key=lambda f: (f.figures.get("share", 0.0), f.figures.get("force", 0.0)))


def named_causes(diagnosis: Diagnosis) -> list[Cause]:
    """Return the causes of the verdict, the one with the largest share of the gap first."""
    named = [cause for cause in diagnosis.causes if cause.identifier in diagnosis.verdict]
    return sorted(named, key=lambda cause: -np.nan_to_num(cause.share))


Diagnosis.headline = headline


DIFFERENCE_HEADER = ["difference", "95 % interval", "healthy vehicles"]
MOST_DIFFERENCES = 8  # that are shown
LEAST_DIFFERENCE = (
    0.5  # of the standard deviation of healthy vehicles, below which none is shown [1]; own choice
)
SHOWN = 6  # columns of the table of causes that are always there
LOOSE = 0.5  # half-width of an interval over the value, above which it is loose [1]; own choice


def difference_rows(diagnosis: Diagnosis) -> list[tuple[str, ...]]:
    """Return (what differs, its 95 % interval, the standard deviation of healthy vehicles), the
    largest first.
    """
    large = [d for d in diagnosis.calibration if d.in_deviations > LEAST_DIFFERENCE]
    return [(capital(d.text), *spread(d)) for d in large[:MOST_DIFFERENCES]]


def cause_table(diagnosis: Diagnosis, longest: int = 20) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return header and rows of the causes, a row for every parameter; the first has what is of the
    whole cause.

    When an effect begins, and what it cannot be told from, are columns only where there is such a
    thing to say.
    """
    header = [
        "cause",
        "parameter",
        "value",
        "95 % interval",
        "probability",
        "held-out gain",
        "begins",
        "or else",
    ]
    rows: list[tuple[str, ...]] = []
    for cause in named_causes(diagnosis):
        begins = [onset(t, plain_name(n, longest)) for n, t in cause.onset.items() if t is not None]
        last = [probability(cause.probability), percent(cause.held_out_gain)]
        last += ["\n".join(begins), "\n".join(cause.indistinguishable_from)]
        for k, (name, parameter) in enumerate(cause.parameters.items() or [("", None)]):
            shown = estimate(parameter, unit_of(cause, parameter)) if parameter else ("", "")
            rows.append(
                (cause.identifier, name, *shown, *last)
                if k == 0
                else ("", name, *shown, "", "", "", "")
            )
    keep = [k for k in range(len(header)) if k < SHOWN or any(row[k] for row in rows)]
    return [header[k] for k in keep], [tuple(row[k] for k in keep) for row in rows]


def unseen(diagnosis: Diagnosis) -> str:
    """Return which effects would leave no trace in the training flights at their usual size; empty:
    none.
    """
    alone = [
        item.effects[0]
        for item in diagnosis.identifiability.not_identifiable
        if len(item.effects) == 1
    ]
    names = listed([bare_name(name) for name in alone])
    return f"At its usual size the training flights would not show: {names}." if alone else ""


def warnings(diagnosis: Diagnosis) -> list[str]:
    """Return every warning once; what holds of several flights names them in one line."""
    flights_of: dict[str, list[str]] = {}
    for warning in dict.fromkeys((*diagnosis.identifiability.warnings, *diagnosis.warnings)):
        name, _, text = warning.partition(": ")
        known = name in diagnosis.train + diagnosis.held_out
        flights_of.setdefault(text if known else warning, []).extend([name] if known else [])
    return [f"{', '.join(names)}: {text}" if names else text for text, names in flights_of.items()]


def next_steps(diagnosis: Diagnosis) -> list[str]:
    """Return what to do next, the most useful first."""
    if diagnosis.cannot_tell:
        tried = [
            item.manoeuvre for item in diagnosis.identifiability.not_identifiable if item.manoeuvre
        ]
        return [
            (
                f"Fly with more motion in every "
                f"axis{f', such as: {tried[0]}' if tried else ''}. Diagnose again."
            )
        ]
    causes = named_causes(diagnosis)
    out = [
        f"To check {name_of(c.identifier)}: {check}."
        for c in causes
        if (check := effect_of(c.identifier).bench_check)
    ]
    for cause in causes:
        others = cause.indistinguishable_from
        if others:
            between = (
                f"{name_of(cause.identifier)} from {listed([name_of(o) for o in others], 'or')}"
            )
            how = manoeuvre((cause.identifier, *others)).rstrip(".")
            out.append(f"To tell {between}, fly: {how}; or the flight of np-drake next-flight.")
        elif loose := _loose(cause):
            more = effect_of(cause.identifier).excited_by or "a longer one with more motion"
            out.append(
                f"Intervals of {cause.identifier} are wide ({listed(loose)}); a better "
                f"flight: {more}."
            )
    if any("not tested" in sentence for sentence in diagnosis.coverage):
        out.append("Hold out a flight that moves like the training flights.")
    if diagnosis.not_flyable:
        out.insert(0, f"Do not fly the corrected simulator: {diagnosis.not_flyable}.")
    elif causes:
        them = "it" if len(causes) == 1 else "them"
        out.append(
            f"Add {them} to the simulator with the values of the table, and diagnose new "
            f"flights with that."
        )
    return [capital(step) for step in out]


def _loose(cause: Cause) -> list[str]:
    """Return the parameters whose interval is wide, if the widest of the effect's values is one of
    them.
    """
    wide = {
        name: 0.5 * (p.ci95[1] - p.ci95[0]) > LOOSE * abs(p.value) > 0
        for name, p in cause.parameters.items()
    }
    alike = max((abs(p.value) for p in cause.parameters.values()), default=0.0)
    main = [name for name, p in cause.parameters.items() if abs(p.value) == alike]
    return [name for name in wide if wide[name]] if any(wide[name] for name in main) else []


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
