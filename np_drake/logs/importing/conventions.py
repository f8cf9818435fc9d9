"""Check of a log's conventions: the declared ones must agree with the log, or those that do are
named.
"""

import dataclasses as dc
import itertools
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import scipy

from np_drake.logs.errors import LogError
from np_drake.logs.importing.alignment import common_rows
from np_drake.logs.importing.laws import (
    AGREES,
    FAILS,
    OPPOSED,
    SCALE,
    WINDOW,
    Misfits,
    Windows,
    failing,
    laws_for,
    misfits,
    never_tilts,
    stretches,
    told_by_noise,
)
from np_drake.logs.importing.log_map import (
    BODIES,
    DIRECTIONS,
    ORDERS,
    UNITS,
    WORLDS,
    LogMap,
    Values,
    axes_of_word,
    convert,
)
from np_drake.logs.importing.signals import Signals, clock_of

DOUBTED = 0.15  # misfit above which a part of a log may be disturbed [1]; own choice
# interval of a state in a flight log [s]; own choice
SHORTEST = 1e-4
LONGEST = 0.2
# log likelihood ratio from which a turn is preferred to another [nat]; own choice: 1 in 22,000
SURE = 10.0
SEARCHED = 2000  # rows on which other conventions are tried; own choice
LEAST_SECONDS = 1.0  # of a log whose unit of time is found by its rate alone [s]; own choice
UPS = ("enu", "ned", "eus", "edn", "uen", "dne")  # worlds; turned about the vertical, none differ
TURNED = {*UPS[2:], *BODIES[2:]}  # frames that are no habit: changed with one other option at most

# options of the map, dotted, and their values: one other convention
Change = tuple[tuple[str, Any], ...]


class WrongConventions(LogError):
    """A log does not agree with the conventions declared.

    Args:
        verdict: with the conventions with which it does agree, if any.
    """

    def __init__(self, message: str, verdict: "Verdict"):
        super().__init__(message)
        self.verdict = verdict


@dc.dataclass(frozen=True)
class Verdict:
    """Outcome of the check.

    misfits: of the declared conventions, by law.
    failed: laws that do not hold.
    changes: options of the map, the fewest with which all laws hold; empty where none are needed or
        none are found.
    rivals: other sets of as few.
    """

    misfits: Misfits
    failed: tuple[str, ...]
    changes: Change = ()
    rivals: tuple[Change, ...] = ()


def check_conventions(t: np.ndarray, raw: Values, log_map: LogMap) -> Verdict:
    """Check the conventions of a log, and search for those that agree where the declared ones do
    not.

    The lift is no law of kinematics: where it alone fails and no other convention makes it hold,
    another force acts, as of a payload. Nor does an axis refuse a log whose noise explains what
    disagrees, as of a gyro that drifts (`told_by_noise`).

    Args:
        t: (n,) evenly spaced times [s].
        raw: columns (n, k) of the log at these times, by quantity.
    """
    declared = misfits(t, convert(raw, log_map))
    failed = tuple(failing(declared))
    turned = turned_attitude(t, raw, log_map, Verdict(declared, failed))
    if not failed:
        return turned or Verdict(declared, ())
    laws = {law.split()[0] for law in declared}  # none is lost that could be tested before
    singles = list(_alternatives(raw, log_map))
    several = [change for change in singles if not change[0][0].endswith(".signs")]
    usual = [change for change in several if change[0][1] not in TURNED]
    part = liveliest(raw, len(t))
    trial = Trial(t[part], {name: values[part] for name, values in raw.items()})
    for count, pool in enumerate((singles, several, usual), start=1):
        fitting = []
        for chosen in itertools.combinations(pool, count):
            change = tuple(itertools.chain(*chosen))
            if len({option for option, _ in change}) < len(change):
                continue
            now = trial.misfits(changed(log_map, change))
            if any(misfit >= AGREES for misfit in now.values()):
                continue
            if len(t[part]) < len(t):
                now = misfits(t, convert(raw, changed(log_map, change)), everything=True)
            if laws <= {law.split()[0] for law in now} and all(
                misfit < AGREES for misfit in now.values()
            ):
                fitting.append((sum(m**2 for m in now.values()), change))
        if fitting:
            changes = [change for _, change in sorted(fitting, key=lambda pair: pair[0])]
            return Verdict(declared, failed, changes[0], tuple(changes[1:]))
        if turned:
            return turned
    aside = told_by_noise(declared)
    disturbed = all(
        law in aside or (law.startswith("lift") and declared[law] < OPPOSED) for law in failed
    )
    return Verdict(declared, () if disturbed else failed)


def turned_attitude(
    t: np.ndarray, raw: Values, log_map: LogMap, verdict: Verdict
) -> Verdict | None:
    """Return the verdict with the right-angle turns that attitude and gyro tell together, however
    little they move and whatever else fails; None where they tell none.

    Each turn has the log likelihood ratio of two Gaussian signals about each axis to no relation.

    Args:
        t: (n,) evenly spaced times [s].
        raw: columns (n, k) of the log at these times, by quantity.
        verdict: that of the other laws.
    """
    over = Windows(t, WINDOW)
    tells = {"attitude", "rates"} <= raw.keys() and not log_map.rates.is_turned("rates")
    if not over.fit or not tells:
        return None
    x = convert(raw, dc.replace(log_map, board_turn=0.0))
    moves = np.concatenate([over.turn(x["attitude"]), over.integral(x["rates"])], axis=1)
    moves = (moves - moves.mean(axis=0)) / np.maximum(moves.std(axis=0), 1e-9)
    correlation = moves[:, :3].T @ moves[:, 3:] / len(moves)
    declared = log_map.frames(log_map.attitude)[1]
    back = axes_of_word(declared).T
    count = (t[-1] - t[0]) / WINDOW
    of_word = {word: np.diag(axes_of_word(word) @ back @ correlation) for word in BODIES}
    unexplained = {
        word: np.maximum(1 - np.maximum(r, 0.0) ** 2, 1e-9) for word, r in of_word.items()
    }
    score = {word: float(-0.5 * count * np.log(rest).sum()) for word, rest in unexplained.items()}
    ranked = sorted(BODIES, key=lambda word: -score[word])
    best = of_word[ranked[0]]
    of_declared = of_word[declared]
    likely = [word for word in ranked if score[ranked[0]] - score[word] < SURE]
    # About no axis do they move against each other: another convention would be wrong, too.
    if declared in likely or best.min() < -2 / np.sqrt(count):
        return None
    axes = {"attitude axes": float(1 - of_declared[np.argmax(best - of_declared)])}
    first, *others = ((("attitude.body", word),) for word in likely)
    rest = check_conventions(t, raw, changed(log_map, first))
    return Verdict(
        axes | verdict.misfits,
        (*axes, *verdict.failed),
        (*first, *rest.changes),
        (*((*first, *change) for change in rest.rivals), *others),
    )


class Trial:
    """Misfits of one log under many maps: what two of them share is computed once.

    Args:
        t: (n,) evenly spaced times [s].
        raw: (n, k) columns by quantity.
    """

    def __init__(self, t: np.ndarray, raw: Values):
        self._over = Windows(t, WINDOW)
        self._raw = raw
        self._misfits: dict[Any, Misfits] = {}

    def misfits(self, log_map: LogMap) -> Misfits:
        """Return what `laws.misfits` does of everything in the log, converted by this map."""
        out: Misfits = {}
        for needed, law in laws_for(self._raw) if self._over.fit else ():
            key = (law, *self._conventions(needed, log_map))
            if key not in self._misfits:
                x = convert(
                    {n: self._raw[n] for n in self._raw.keys() & {*needed, "attitude"}}, log_map
                )
                self._misfits[key] = law(self._over, True, *(x[name] for name in needed))
            out |= self._misfits[key]
        return out

    def _conventions(self, names: tuple[str, ...], log_map: LogMap) -> tuple[Any, ...]:
        """Return what these quantities depend on: their own conventions, and those of the attitude
        where it turns one of them.
        """
        turned = any(getattr(log_map, name).is_turned(name) for name in names)
        sources = (getattr(log_map, name) for name in (*names, *(["attitude"] if turned else [])))
        return tuple((repr(source), *log_map.frames(source)) for source in sources)


def liveliest(raw: Values, rows: int) -> slice:
    """Return the part of at most `SEARCHED` rows in which the attitude, or else the position,
    varies most.

    Args:
        raw: (rows, k) columns by quantity.
    """
    if rows <= SEARCHED:
        return slice(0, rows)
    value = raw["attitude" if "attitude" in raw else "position"]
    first = max(
        [*range(0, rows - SEARCHED, SEARCHED // 2), rows - SEARCHED],
        key=lambda k: float(np.sum(np.var(value[k : k + SEARCHED], axis=0))),
    )
    return slice(first, first + SEARCHED)


def require_a_likely_clock(signals: Signals, log_map: LogMap, path: str) -> None:
    """Check that samples come at a rate of flight logs, 5 Hz to 10 kHz.

    Raises: WrongConventions: with the unit of time that gives such a rate, if the log would then be
        long enough to be a flight; LogError: else.
    """
    clock = clock_of(signals)
    declared = UNITS["time"][log_map.time.unit or "s"]
    if SHORTEST <= clock.step <= LONGEST:
        return
    for unit, factor in sorted(UNITS["time"].items(), key=lambda u: abs(np.log(u[1] / declared))):
        scale = factor / declared
        if SHORTEST <= clock.step * scale <= LONGEST and scale * np.ptp(clock.t) >= LEAST_SECONDS:
            raise WrongConventions(
                f"{path}: it does not fit the conventions declared (rows of the attitude not "
                f"0.1 ms to 0.2 s apart), but fits time.unit: {unit}. Write that in the map.",
                Verdict({}, ("interval",), (("time.unit", unit),)),
            )
    raise LogError(
        f"{path}: rows of the state must be 0.1 ms to 0.2 s apart; got "
        f"{clock.step * declared:.4g} s. Log at a higher rate, or export the times with all their "
        "digits."
    )


def changed(log_map: LogMap, change: Change) -> LogMap:
    """Return the map with options changed.

    Args:
        change: options and their values; a dotted option is one of a quantity.
    """
    for option, value in change:
        name, _, field = option.partition(".")
        if field:
            value = dc.replace(getattr(log_map, name), **{field: value})
        log_map = dc.replace(log_map, **{name: value})
    return log_map


def as_text(change: Change) -> str:
    """Return a change as it stands in a map."""
    return ", ".join(f"{option}: {value}" for option, value in change)


def _explained(change: Change, log_map: LogMap) -> str:
    """Return a change as it stands in a map, and by which turn the attitude then differs from what
    was declared.
    """
    body = dict(change).get("attitude.body")
    text = as_text(change)
    if body is None:
        return text
    turn = scipy.spatial.transform.Rotation.from_matrix(
        axes_of_word(log_map.frames(log_map.attitude)[1]).T @ axes_of_word(body)
    ).as_rotvec(degrees=True)
    signed = zip("xyz", np.sign(turn.round()), strict=True)
    axes = [f"-{axis}" if sign < 0 else axis for axis, sign in signed if sign]
    about = axes[0] if len(axes) == 1 else f"the diagonal of {', '.join(axes)}"
    return (
        f"{text} (the attitude's axes are turned by {np.linalg.norm(turn):.0f} deg about {about})"
    )


def _alternatives(raw: Values, log_map: LogMap) -> Iterator[Change]:
    """Yield every other convention that a log may need."""
    yield from ((("world", world),) for world in UPS if world != log_map.world)
    yield (("body", _other(BODIES, log_map.body)),)
    if "position" in raw and "velocity" in raw:
        worlds = {
            name: log_map.frames(getattr(log_map, name))[0] for name in ("position", "velocity")
        }
        yield tuple(
            (f"{name}.world", _other(WORLDS, declared)) for name, declared in worlds.items()
        )
    if {"attitude", "rates"} <= raw.keys():  # by another instrument, as motion capture
        declared = log_map.frames(log_map.attitude)[1]
        yield from ((("attitude.body", body),) for body in BODIES if body != declared)
    for name in raw:
        for options in _of_quantity(name, log_map):
            if "attitude" in raw or not {"kind", "axes"} & options.keys():  # else of the body alone
                yield tuple((f"{name}.{option}", value) for option, value in options.items())


def _of_quantity(name: str, log_map: LogMap) -> Iterator[dict[str, Any]]:
    """Yield every other convention of one quantity, options by name."""
    source = getattr(log_map, name)
    world, body = log_map.frames(source)
    axes = source.axes_of(name)
    if name == "acceleration":
        declared = (source.kind or "specific_force", axes)
        kinds = itertools.product(("specific_force", "acceleration"), ("body", "world"))
        yield from ({"kind": kind, "axes": a} for kind, a in kinds if (kind, a) != declared)
    turns = name == "attitude"
    euler = len(source.columns) == 3
    vector = name in VECTORS
    pairs = (  # option, its two words, that of the map, and whether this quantity has it
        ("unit", ("deg", "rad"), source.unit, turns and euler),
        ("order", ORDERS, source.order, turns and not euler),
        ("direction", DIRECTIONS, source.direction, turns),
        ("world", WORLDS, world, turns or (axes == "world" and vector)),
        ("body", BODIES, body, axes == "body" and vector and not turns),
        ("axes", ("world", "body"), axes, name in ("velocity", "rates")),
    )
    yield from ({option: _other(words, declared)} for option, words, declared, has in pairs if has)
    units = _UNITS.get(name, ())
    yield from ({"unit": unit} for unit in units if unit != (source.unit or units[0]))
    if name in ("acceleration", "thrust", "velocity"):
        yield {"scale": -source.scale}
    if name in HANDED and len(source.columns) == 3:
        signs = np.array(source.signs or [1, 1, 1])
        yield from ({"signs": (signs * (1 - 2 * axis)).tolist()} for axis in np.eye(3, dtype=int))


# three columns of which a log may turn one, as pitch against a right-handed y
HANDED = "attitude", "rates"
VECTORS = ("position", "velocity", "rates", "acceleration")
_UNITS: Mapping[str, tuple[str, ...]] = {
    "position": ("m", "cm", "mm"),
    "velocity": ("m/s", "cm/s", "mm/s"),
    "rates": ("rad/s", "deg/s"),
    "acceleration": ("m/s2", "g"),
}


def _other(pair: tuple[str, ...], word: str) -> str:
    return pair[1] if word == pair[0] else pair[0]


CHECK_RATE = 50.0  # of the rows on which conventions are checked [Hz]
SPAN = 2.0  # over which a law is tested by itself [s]; own choice: four windows of a law
TEST_STEP = 0.1  # between two such tests [s]
MOST_TESTS = 600  # of one part; own choice
SHORTEST_STRETCH = 3.0  # that is taken of a part that does not fit as a whole [s]; own choice
# misfit, that of no agreement, from which the end of a part is left out though the whole holds [1]
ENDS_BADLY = 1.0


def fitting_stretch(
    signals: Signals, log_map: LogMap, verdict: Verdict
) -> tuple[float, float] | None:
    """Return the longest stretch in which the laws hold that fail in the whole [s]; None where
    there is none.

    A law must be tested there, not only be silent. Where the whole holds, the end alone is looked
    at: a short crash hides in a long flight.
    """
    t, raw = _checked_rows(signals)
    x = convert(raw, log_map)
    rows = round(SPAN * CHECK_RATE)
    starts = range(0, len(t) - rows + 1, max(round(TEST_STEP * CHECK_RATE), len(t) // MOST_TESTS))
    laws = {law for law in verdict.failed or verdict.misfits if not law.startswith("lift")}
    most = FAILS if verdict.failed else ENDS_BADLY

    def holds(k: int) -> bool:
        of_window = misfits(
            t[k : k + rows], {name: values[k : k + rows] for name, values in x.items()}
        )
        return all(of_window.get(law, 0.0) <= most for law in laws)

    good = np.array([holds(k) for k in starts])
    edges = stretches(good)
    if not len(edges) or good.all():
        return None
    first, after = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    to_the_end = after == len(good)
    if not verdict.failed and (first > 0 or to_the_end or good[after:].any()):
        return None
    start = t[starts[first]]
    stop = t[-1] if to_the_end else t[starts[after - 1] + rows - 1] - WINDOW
    return (float(start), float(stop)) if stop - start >= SHORTEST_STRETCH else None


def judged(signals: Signals, log_map: LogMap, path: str) -> Verdict:
    """Return the verdict on the conventions of a log that flies.
    Raises: LogError: if the attitude never tilts where the vehicle accelerates sideways.
    """
    t, raw = _checked_rows(signals)
    if level := never_tilts(t, convert(raw, log_map)):
        tilt, needed = level
        raise LogError(
            f"{path}: the attitude must tilt where the vehicle accelerates sideways; "
            f"{log_map.attitude.columns[0]} … "
            f"tilts by {1e3 * tilt:.2g} mrad where {1e3 * needed:.0f} mrad are needed, as "
            f"a planar odometry does. Name "
            "a pose with roll and pitch in a map."
        )
    return check_conventions(t, raw, log_map)


def _checked_rows(signals: Signals) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    return common_rows({n: s for n, s in signals.items() if n != "voltage"}, CHECK_RATE)


def agreed(
    verdict: Verdict, signals: Signals, log_map: LogMap, path: str, *, adopt: bool
) -> tuple[LogMap, Verdict]:
    """Return the map whose conventions agree with the log, and the verdict on them.

    Raises: WrongConventions: if those declared do not agree, unless others do and are to be
        adopted.
    """
    if not verdict.failed:
        return log_map, verdict
    laws = [f"misfit of {law} {verdict.misfits[law]:.2g}" for law in verdict.failed[:4]]
    wrong = f"{', '.join(laws)}; {SCALE}"
    if not verdict.changes:
        raise WrongConventions(
            f"{path}: its quantities must agree with each other in the conventions "
            f"declared ({wrong}), and agree in no "
            "other that is known. Check columns, units and frames of the map, and leave "
            "damaged rows out with "
            "--start and --stop.",
            verdict,
        )
    if not adopt or verdict.rivals:
        fits = (verdict.changes, *verdict.rivals[:3])  # of turns about one axis, all
        fit = "; or ".join(_explained(change, log_map) for change in fits)
        raise WrongConventions(
            f"{path}: it does not fit the conventions declared ({wrong}), but fits {fit}. "
            "Write that in the map" + ("." if verdict.rivals else ", or give --adopt."),
            verdict,
        )
    log_map = changed(log_map, verdict.changes)
    return log_map, dc.replace(judged(signals, log_map, path), changes=verdict.changes)
