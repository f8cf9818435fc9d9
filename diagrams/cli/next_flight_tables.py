"""A proposed flight on the terminal: what it finds in a sentence, manoeuvres, pairs, intervals, and
its check.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations

import numpy as np

from diagrams.cli.output import Table
from diagrams.gap.limits_check import Flown
from np_drake.effects.explanation import STANDS, Explanation
from np_drake.effects.library import effect_of
from np_drake.files.number_text import NOTHING, number, of_at_least, percent, probability
from np_drake.flight_design.prediction import Prediction

HARDLY = 1.0  # distance of a pair below which it is hardly told apart [nat]
LEFT = "left out"  # cell of a manoeuvre that cannot be flown
EVEN = 0.5  # probability to be named from which an explanation is [1]
SURE = 10.0  # distance of a pair beyond which more tells nothing more [nat]


def rank(prediction: Prediction) -> tuple[float, float]:
    """Return what a manoeuvre tells, as its table shows it: what tells more is larger."""
    told = prediction.information
    if told.weakest is None:
        return 0.0, round(told.parameters(0), 1)
    return round(100 * told.outlook.worst, 0), float(
        f"{min(told.distances[told.weakest], SURE):.2g}"
    )


def hopeless(told: Mapping[str, Prediction]) -> bool:
    """Return whether no manoeuvre tells any two explanations apart."""
    known = [prediction.information for prediction in told.values()]
    return all(i.weakest is not None and np.max(i.distances) < HARDLY for i in known)


def sentence(explanations: Sequence[Explanation]) -> str:
    """Return what still stands, in one line."""
    told = ", ".join(f"{e.label} ({probability(e.probability)})" for e in explanations)
    if len(explanations) == 1:
        return f"One explanation stands: {told}. The flight is for its parameters."
    return f"{len(explanations)} explanations stand: {told}."


def finding(
    explanations: Sequence[Explanation],
    told: Mapping[str, Prediction],
    flown: Sequence[Flown],
    name: str,
) -> str:
    """Return what the flight is expected to tell, in one sentence; or that none will, and what to
    measure instead.

    Args:
        flown: flights of the proposed one in the simulator, under each explanation; none where it
            was not flown.
    """
    best = told[name].information
    if best.weakest is None:
        return (
            f"Fly the {name}: it brings {number(best.parameters(0), 2)} nat about the parameters."
        )
    named = {int(f.posterior.argmax()) for f in flown}
    if flown and len(named) == 1:
        always = explanations[named.pop()].label
        return (
            f"No flight will tell these apart: whatever is true, the log names "
            f"{always}.{_instead(explanations)}"
        )
    if hopeless(told):
        each = best.outlook.each
        always = explanations[each.index(max(each))].label
        why = (
            f"the log would most likely name {always}"
            if max(each) >= EVEN
            else "the log would name none alone"
        )
        return f"No flight will tell these apart: whatever is true, {why}.{_instead(explanations)}"
    if best.outlook.worst < EVEN:
        a, b = (explanations[k] for k in best.weakest)
        others = ", and tells the others" if len(explanations) > 2 else ""
        apart = number(float(best.distances[best.weakest]), 2)
        return (
            f"Fly the {name}: it hardly tells {a.label} from {b.label}, {apart} "
            f"nat{others}.{_instead([a, b])}"
        )
    chance = of_at_least(best.outlook.worst)
    return (
        f"Fly the {name}: whichever explanation is true, it alone is left with a probability "
        f"{chance}."
    )


def _instead(explanations: Sequence[Explanation]) -> str:
    """Return what to measure on the ground, of the effects that the explanations do not share."""
    sets = [set(e.named) for e in explanations]
    shared = sets[0].intersection(*sets[1:])
    differ = sorted(sets[0].union(*sets[1:]) - shared)
    checks = [check for effect in differ if (check := effect_of(effect).bench_check)]
    return f" On the ground: {'; '.join(checks)}." if checks else ""


def verdict(flown: Sequence[Flown], usage: Mapping[str, float]) -> str:
    """Return whether the limits are kept, in one line.

    Args:
        flown: flights in the simulator, all within the limits; none where it was not flown.
        usage: share of each limit that the plan uses [1].
    """
    if not flown:
        return f"Limits: not flown in the simulator; the plan uses {_most(usage)}."
    worst = max(flown, key=lambda f: f.worst)
    return (
        f"Limits: kept in the simulator under each of {len(flown)} explanations that "
        f"stand; most used: "
        f"{_most(worst.usage)}, under {worst.explanation.brief}."
    )


def _most(usage: Mapping[str, float]) -> str:
    name = max(usage, key=lambda name: usage[name])
    return f"{percent(usage[name])} of {name}"


def tables(
    explanations: Sequence[Explanation],
    told: Mapping[str, Prediction],
    flown: Sequence[Flown],
    left_out: Collection[str] = (),
) -> list[Table]:
    """Return the tables of manoeuvres, of pairs, of intervals, and of the flights in the simulator.

    Args:
        told: by manoeuvre, what it tells; the proposed one first.
    """
    prediction = next(iter(told.values()))
    found: list[Table] = [_manoeuvres(told, left_out)]
    if pairs := _pairs(explanations, prediction):
        found.append(
            ("what the flight tells apart", ["pair", "distance [nat]", "told apart"], pairs)
        )
    if rows := _intervals(explanations[0], prediction.intervals[0]):
        header = ["if it is " + explanations[0].label, "value", "± now", "± after the flight"]
        found.append(("intervals of 95 %", header, rows))
    if flown:
        header = ["if it is", "its log gives it", "names one", "most used limit"]
        flights = [
            (f.explanation.label, probability(float(f.posterior[k])), _named(f, k), _most(f.usage))
            for k, f in enumerate(flown)
        ]
        found.append(("the flight in the simulator", header, flights))
    return found


def _manoeuvres(told: Mapping[str, Prediction], left_out: Collection[str]) -> Table:
    """Return a row for each manoeuvre, the proposed one first."""
    title = "manoeuvres, each as large as the limits allow"
    known = {name: prediction.information for name, prediction in told.items()}
    if next(iter(known.values())).weakest is None:
        told_of = [
            (name, LEFT if name in left_out else number(i.parameters(0), 2))
            for name, i in known.items()
        ]
        return title, ["manoeuvre", "about the parameters [nat]"], told_of
    pairs = {name: float(i.distances[i.weakest]) for name, i in known.items()}
    cells = {name: number(d, 2) if d < SURE else f"> {SURE:g}" for name, d in pairs.items()}
    rows = [
        (name, LEFT, NOTHING)
        if name in left_out
        else (name, probability(i.outlook.worst), cells[name])
        for name, i in known.items()
    ]
    return title, ["manoeuvre", "the right one is left alone, at least", "weakest pair [nat]"], rows


def _pairs(explanations: Sequence[Explanation], prediction: Prediction) -> list[tuple[str, ...]]:
    """Return a row for each pair of explanations, the least separated first."""
    distances = prediction.information.distances
    pairs = sorted(combinations(range(len(explanations)), 2), key=lambda ij: distances[ij])
    said = [
        (f"{explanations[i].label} – {explanations[j].label}", distances[i, j]) for i, j in pairs
    ]
    return [(pair, number(d, 2), "hardly" if d < HARDLY else "yes") for pair, d in said]


def _intervals(
    explanation: Explanation, intervals: Mapping[str, tuple[float, float]]
) -> list[tuple[str, ...]]:
    """Return a row for each parameter of the effects that an explanation names."""
    values = {
        f"{e.identifier}.{name}": v for e in explanation.effects for name, v in e.values.items()
    }
    named = {
        name: pair for name, pair in intervals.items() if name.split(".")[0] in explanation.named
    }
    return [
        (name, number(values[name]), number(a, 2), number(b, 2)) for name, (a, b) in named.items()
    ]


def _named(flown: Flown, k: int) -> str:
    rest = max((p for j, p in enumerate(flown.posterior) if j != k), default=0.0)
    return "yes" if flown.posterior[k] > STANDS * rest else "no"
