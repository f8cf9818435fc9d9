"""Figures that are asked of the diagnosis on real flights, over all cases, by method."""

import dataclasses as dc
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from diagrams.challenge.real.calibration import calibration_error
from diagrams.challenge.real.campaigns import CAMPAIGNS, GROUPS, campaign_of
from diagrams.challenge.real.score import BASELINES, BIC, THIS, TOLD
from diagrams.challenge.real.truth import (
    DRAG,
    DRAGS,
    EXCLUDED_BESIDE_WIND,
    GROUND,
    LINEAR_UP_TO,
    PAYLOAD,
    PLACE,
    SURE,
    WINDS,
    WITHIN_ANGLE,
    WITHIN_FORCE,
    WITHIN_POSITION,
    WITHIN_SPEED,
    named,
)
from np_drake.diagnosis.result import UNKNOWN

Record = Mapping[str, Any]  # of `Scoring`
Answer = Mapping[str, Any]  # score of a method in a case, see `answers`
HEALTHY = tuple(c.group for c in CAMPAIGNS if c.truth.healthy)
GROUND_GROUPS = tuple(c.group for c in CAMPAIGNS if GROUND in c.truth.present)
COMMANDED = "payload-command"  # the payload flights of another group once more
PAYLOADS = tuple(c.group for c in CAMPAIGNS if PAYLOAD in c.truth.present and c.group != COMMANDED)
KNOWN = tuple(g for g in GROUPS if g != "neurobem")


def methods_of(records: Sequence[Record], kind: str = "all") -> list[str]:
    """Return the methods of the records: the diagnosis, answers beside it, then the baselines.

    Args:
        records: of `Scoring`.
        kind: all | naming, those that give probabilities | answering, those of a `diagnosis.json`.
    """
    used = dict.fromkeys(name for record in records for name in record["methods"])
    own = sorted((name for name in used if name not in BASELINES), key=lambda name: name != THIS)
    apart = {"all": BASELINES, "naming": (BIC,), "answering": ()}[kind]
    return [*own, *(name for name in apart if name in used)]


def answers(
    records: Sequence[Record], groups: Collection[str] = GROUPS, methods: Collection[str] = ()
) -> list[Answer]:
    """Return the scores of methods in the cases of some groups, with "group", "case", "by" and
    "fans" of each.

    Args:
        records: of `Scoring`.
        methods: names of methods, empty: all; one that did not answer a case is left out there.
    """
    return [
        {
            "group": record["group"],
            "case": record["case"],
            "by": method,
            "fans": record.get("wind"),
            **record["methods"][method],
        }
        for record in records
        if record["group"] in groups
        for method in methods or methods_of(records)
        if method in record["methods"]
    ]


def beyond_drag(answer: Answer) -> int:
    """Return how many names an answer has beyond drag."""
    return sum(name not in (*DRAGS, PLACE, UNKNOWN) for name in named(answer["causes"]))


def gains_nothing(answer: Answer) -> bool | None:
    """Return whether an answer has a name and makes the held-out residual worse; None where it
    tells no reduction.
    """
    fraction = answer.get("fraction")
    return None if fraction is None else bool(fraction < 0 and named(answer["causes"]))


def _count(values: Sequence[bool]) -> str:
    return f"{sum(values)} of {len(values)}"


def _centimetres(values: Sequence[float]) -> str:
    return f"{100 * np.median(values):.1f}, max {100 * max(values):.1f}"


@dc.dataclass(frozen=True)
class Asked:
    """Line of the table: what is asked of the cases of some groups.

    figure: of an answer; None: it does not count.
    kind: methods of which it is asked, of `methods_of`. gather: cell of all figures.
    """

    what: str
    wanted: str
    groups: Collection[str]
    figure: Callable[[Answer], Any]
    kind: str = "all"
    gather: Callable[[list], str] = _count

    def cell(self, records: Sequence[Record], method: str) -> str | None:
        """Return the cell of a method; None where it has no figure.

        Args:
            records: of `Scoring`.
        """
        if method not in methods_of(records, self.kind):
            return None
        figures = [self.figure(answer) for answer in answers(records, self.groups, [method])]
        known = [figure for figure in figures if figure is not None]
        return self.gather(known) if known else None


def asked_figures(records: Sequence[Record]) -> list[dict[str, Any]]:
    """Return lines with what is asked, what is wanted, and what each method gives, where one gives
    anything.
    """
    lines = []
    for asked in _asked():
        cells = {
            method: cell
            for method in methods_of(records)
            if (cell := asked.cell(records, method)) is not None
        }
        if cells:
            lines.append({"what": asked.what, "wanted": asked.wanted, **cells})
    return lines


def _asked() -> Iterator[Asked]:
    yield Asked(
        "healthy: cases with a false name", "≤ 5 %", HEALTHY, lambda a: bool(a["wrong"]), "naming"
    )
    names = partial(Asked, groups=HEALTHY, figure=beyond_drag, kind="naming")
    yield names("healthy: names beyond drag, median", "0", gather=lambda n: f"{np.median(n):g}")
    yield names("healthy: names beyond drag, mean", "≤ 0.5", gather=lambda n: f"{np.mean(n):.2f}")
    yield from _of_payloads(PAYLOADS, "payload")
    yield from _of_payloads((COMMANDED,), "payload, command")
    yield from _of_wind()
    yield Asked(
        "still air: cases with a false name", "0", ["still"], lambda a: bool(a["wrong"]), "naming"
    )
    new = partial(Asked, groups=["new-wind"])
    yield new(
        "new wind: said so", "all", figure=lambda a: bool(a["new_condition"]), kind="answering"
    )
    yield new(
        "new wind: cases with a false name", "0", figure=lambda a: bool(a["wrong"]), kind="naming"
    )
    yield Asked("ground effect: named, of the right size", "≥ 80 %", GROUND_GROUPS, _ground_is_told)
    yield Asked("all: named, and held out worse", "0", GROUPS, gains_nothing, "answering")
    yield Asked("known cause: right", f"more than {BIC}", KNOWN, lambda a: a["right"], "naming")
    what = f"all: wrong names, p > {SURE:g}"
    yield Asked(what, "0", GROUPS, _sure_and_wrong, "naming", lambda counts: str(sum(counts)))
    yield Asked(
        "all: calibration error of names", "", GROUPS, _judged, "naming", _calibration_error
    )
    seconds = partial(
        Asked, wanted="", groups=GROUPS, figure=lambda a: a["seconds"], kind="answering"
    )
    yield seconds("seconds a case, median", gather=lambda values: f"{np.median(values):.1f}")
    yield seconds("seconds a case, most", gather=lambda values: f"{max(values):.1f}")


def _judged(answer: Answer) -> list[tuple[float, bool]]:
    return campaign_of(answer["group"]).truth.judged(answer["causes"], answer["late"])


def _calibration_error(judged: Sequence[Sequence[tuple[float, bool]]]) -> str:
    error = calibration_error([pair for pairs in judged for pair in pairs])
    return "" if error is None else f"{error:.3f}"


def _sure_and_wrong(answer: Answer) -> int:
    return sum(answer["causes"][name] > SURE for name in answer["wrong"])


def _ground_is_told(answer: Answer) -> bool:
    said = answer["by"] == TOLD or GROUND in named(answer["causes"])
    return said and is_within("effective_radius", answer)


def _of_payloads(groups: Collection[str], title: str) -> Iterator[Asked]:
    of_group = partial(Asked, groups=groups)
    yield of_group(
        f"{title}: named", "≥ 95 %", figure=lambda a: PAYLOAD in named(a["causes"]), kind="naming"
    )
    for name, error in (("mass", 10), ("length", 5)):
        yield of_group(f"{title}: {name} within {error} %", "all", figure=partial(is_within, name))
    both = f"{title}: both in the 95 % interval"
    yield of_group(
        both, "≥ 90 %", figure=lambda a: all(is_covered(name, a) for name in ("mass", "length"))
    )
    for key, how in (("observed", "observed"), ("open", "open loop")):
        what = f"{title}: position, {how}, RMSE [cm]"
        most = f"≤ {100 * WITHIN_POSITION:.0f}" if key == "observed" else ""
        yield of_group(what, most, figure=partial(_position_error, key), gather=_centimetres)


def _position_error(key: str, answer: Answer) -> float | None:
    return answer.get("position", {}).get(key)


def estimate(name: str, answer: Answer) -> Mapping[str, Any]:
    """Return value and interval of a parameter of the known cause; empty where it is not told."""
    present = campaign_of(answer["group"]).truth.present
    return next(
        (found[name] for n in present if name in (found := answer["parameters"].get(n, {}))), {}
    )


def is_within(name: str, answer: Answer) -> bool:
    """Return whether a parameter of the known cause is in the asked range; False where it has
    none.
    """
    return (
        campaign_of(answer["group"])
        .truth.parameters[name]
        .holds(estimate(name, answer).get("value"))
    )


def is_covered(name: str, answer: Answer) -> bool:
    """Return whether the 95 % interval of a parameter of the known cause holds the truth; False
    where there is none.
    """
    low, high = estimate(name, answer).get("ci95", (None, None))
    known = campaign_of(answer["group"]).truth.parameters[name]
    return low is not None and high is not None and low <= known.value <= high


def _of_wind() -> Iterator[Asked]:
    of_wind = partial(Asked, wanted="all", groups=["wind"])
    yield of_wind("wind: with drag, no mass or clock error", figure=_wind_is_named, kind="naming")
    what = f"wind: direction within {WITHIN_ANGLE:.0f}°"
    yield of_wind(what, figure=partial(_wind_is_within, "angle", 0.0, WITHIN_ANGLE))
    what = f"wind: mean force within {100 * WITHIN_FORCE:.0f} %"
    yield of_wind(
        what, wanted="5 of 6", figure=partial(_wind_is_within, "force", 1.0, WITHIN_FORCE)
    )
    what = f"wind below {LINEAR_UP_TO:.0f} m/s: speed within {100 * WITHIN_SPEED:.0f} %"
    yield of_wind(what, figure=_gentle_speed_is_within)


def _wind_is_named(answer: Answer) -> bool:
    """Return whether a wind and a linear drag are named, and no mass or clock error beside them."""
    names = set(named(answer["causes"]))
    return bool(names & set(WINDS)) and DRAG in names and not names & set(EXCLUDED_BESIDE_WIND)


def _wind_is_within(figure: str, about: float, within: float, answer: Answer) -> bool:
    """Return whether a figure of the wind is within the asked error; False where no wind is
    told.
    """
    value = answer.get("wind", {}).get(figure)
    return value is not None and abs(value - about) <= within


def _gentle_speed_is_within(answer: Answer) -> bool | None:
    """Return whether the speed of the wind is within the asked error; None where the fans blow
    harder.
    """
    return (
        _wind_is_within("speed", 1.0, WITHIN_SPEED, answer)
        if answer["fans"] <= LINEAR_UP_TO
        else None
    )


def judged_names(records: Sequence[Record], method: str = THIS) -> list[tuple[float, bool]]:
    """Return probability and truth of every name of which the truth is known.

    Args:
        records: of `Scoring`.
    """
    return [pair for answer in answers(records, methods=[method]) for pair in _judged(answer)]
