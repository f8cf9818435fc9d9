"""Study `real`: the diagnosis, or answers of any tool, on real flights whose cause is known."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import joblib
import numpy as np
import pandas as pd
import scipy
from typer import Option

from diagrams.batch.run import FailedRun, Report, Run, Table, failures
from diagrams.evidence.challenge.answers import ANSWER_FILE, REAL_ANSWER, read_answer
from diagrams.evidence.real import campaigns
from diagrams.evidence.real.campaigns import DRAG, GROUND, PAYLOAD, PLACE, WINDS, Truth, campaign_of
from diagrams.evidence.scoring import (
    SURE,
    aggregate,
    calibration,
    calibration_figure,
    listed,
    table,
)
from diagrams.evidence.studies.options import REAL_FLIGHTS, Group, Neurobem, RealFlights, required
from diagrams.gap.drake_replay import DrakeReplay
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals import FlightResiduals, make_flight_residuals
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.base import Effect, Motion, WrenchEffect
from np_drake.effects.combine import split_effects, total_wrench
from np_drake.effects.ground_effect import GroundEffect
from np_drake.effects.library import causes as library_causes
from np_drake.effects.pendulum import hanging, swing_many
from np_drake.files.file_access import write_json
from np_drake.flight_log import FlightLog
from np_drake.logs.importing.signals import Signal
from np_drake.rigid_body import V
from np_drake.vehicle import Vehicle

# the diagnosis; forward selection by least squares
THIS = "this"
BIC = "BIC"
STEP = 0.02  # between the instants at which a force is averaged [s]
TOP = 5  # names that are shown of a method
DIRECTION = np.array([-1.0, 0.0])  # of the wind of the fans in the plane [1]
# Asked of a wind: figure, what it should be, and within what. Its speed only up to 6 m/s, to which
# linear drag holds.
WITHIN = {"angle": (0.0, 10.0), "force": (1.0, 0.15), "speed": (1.0, 0.30)}  # [deg, 1, 1]
GENTLE = 6.0  # [m/s]
BESIDE_WIND = {"mass_error", "clock_offset"}  # no names beside a wind


# Score of one case


def effects_of(answer: Mapping[str, Any], names: Iterable[str]) -> list[Effect]:
    """Return the effects of an answer at their values, as far as the library knows them."""
    effects = []
    for cause in answer["causes"]:
        kind = library_causes().get(cause["effect"]) if cause["effect"] in names else None
        if kind:
            given = cause.get("parameters", {})
            values = {p.name: given.get(p.name, {}).get("value") for p in kind.parameters}
            effects.append(kind(**{n: v for n, v in values.items() if v is not None}))
    return effects


def mean_force(flights: Iterable[FlightLog], vehicle: Vehicle) -> np.ndarray:
    """Return the mean force that the nominal model leaves, over flights, (3,) in W [N]."""
    residuals = [make_flight_residuals(log, vehicle) for log in flights]
    forces = [(e.R_WB @ e.y[:, :3, None])[..., 0].mean(axis=0) for e in residuals]
    return np.mean(forces, axis=0)


def force_of(log: FlightLog, vehicle: Vehicle, effects: Sequence[WrenchEffect]) -> np.ndarray:
    """Return the mean force of effects over a flight, (3,) in W [N]; rotors share the thrust."""
    rows = slice(None, None, max(1, int(STEP / log.step)))
    x = log.x[rows].copy()
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    motion = Motion(log.t[rows], x, np.repeat(0.25 * log.u[rows, :1], 4, axis=1))
    return total_wrench(vehicle, effects, motion)[:, :3].mean(axis=0)


def wind_figures(
    effects: Sequence[Effect],
    flights: Sequence[FlightLog],
    vehicle: Vehicle,
    measured: np.ndarray,
    speed: float,
) -> dict[str, float]:
    """Return direction error [deg], mean force over that measured [1], speed over that of the fans
    [1], and speed upwards [m/s] of a wind; empty where no wind is among the effects.

    flights: in the wind, over which its force is averaged. measured: (3,) mean force of the wind in
    W [N]. speed: of the fans [m/s].
    """
    acting = split_effects(effects).wrench
    winds: list[Any] = [effect.predicted for effect in acting if effect.identifier in WINDS]
    if not winds:
        return {}
    drags = [effect for effect in acting if effect.identifier not in WINDS]
    # Of the drags in wind less that of the drags in still air.
    blown = np.mean([force_of(log, vehicle, [*drags, *winds]) for log in flights], axis=0)
    calm = np.mean([force_of(log, vehicle, drags) for log in flights], axis=0) if drags else 0.0
    wind = np.sum([w.air_velocity(0.0) for w in winds], axis=0)
    across = float(np.linalg.norm(wind[:2]))
    along = wind[:2] @ DIRECTION / across if across > 0 else math.nan
    return {
        "angle": math.degrees(math.acos(np.clip(along, -1, 1))),
        "force": (blown - calm)[:2] @ DIRECTION / (measured[:2] @ DIRECTION),
        "speed": across / speed,
        "up": wind[2],
    }


def score_case(
    record: dict[str, Any],
    *,
    folder: Path,
    neurobem: Path | None = None,
    answers: Path | None = None,
    replay: bool = False,
) -> dict[str, Any]:
    """Return of a record {"group", "name"} {"group", "vehicle", "case", "methods", "answer"}:
    names, right, wrong, parameters, held-out figures and seconds of every method.

    folder, neurobem: of the flights, under the same path for all workers.
    answers: folder of answers to score; None: the case is diagnosed, and "answer" holds what was
    said. A case that it does not answer lacks that method.
    replay: the held-out flights are replayed in the nominal and in the corrected simulator.
    Raises: LogError, OSError: if a flight cannot be used; ValueError: if an answer is none.
    """
    cases = campaigns.make_cases(folder, neurobem, [record["group"]])
    case = next(case for case in cases if case.name == record["name"])
    campaign = campaign_of(case.group)
    vehicle = campaign.nominal
    train = campaign.logs(case.train)
    methods: dict[str, Any] = {}
    result: dict[str, Any] = {
        "group": case.group,
        "vehicle": campaign.vehicle,
        "case": case.name,
        **({"wind": case.speed} if case.speed else {}),
        "methods": methods,
    }
    if answers is None:
        diagnosis = diagnose(
            train,
            campaign.open_flights(case.held_out),
            vehicle,
            DrakeReplay(vehicle) if replay else None,
            adaptive_split=case.second,
            before=campaign.logs(case.before),
        )
        answer: dict[str, Any] | None = diagnosis.as_json()
        result["answer"] = answer
    else:
        answer = read_answer(answers / case.folder / ANSWER_FILE, REAL_ANSWER)
    if answer is not None:
        methods[THIS] = scored(answer, campaign.truth, [log.name for log in train])
    if case.still:
        force = mean_force(train, vehicle) - mean_force(campaign.logs(case.still), vehicle)
        result["force"] = force
        if answer is not None:
            effects = effects_of(answer, methods[THIS]["causes"])
            methods[THIS]["wind"] = wind_figures(effects, train, vehicle, force, case.speed)
    flights = [make_flight_residuals(log, vehicle) for log in train]
    y = np.concatenate([e.y[:, :WRENCH] for e in flights])
    methods[BIC] = verdict(select_by_bic(y, library_columns(flights)), campaign.truth)
    return result


def scored(answer: Mapping[str, Any], truth: Truth, fitted: Iterable[str] = ()) -> dict[str, Any]:
    """Return what the content of a `diagnosis.json` says, against the truth.

    A cause that is absent from all flights of the fit is said of the held-out flight, and is not
    judged as theirs.

    fitted: names of the flights of the fit; empty: every cause is theirs.
    """
    fit = set(fitted)
    second = (answer.get("refit") or {}).get("causes", ())

    def absent(cause: Mapping[str, Any]) -> bool:
        return bool(fit) and fit <= set(cause.get("absent_from") or ())

    fitted_causes = [c for c in answer["causes"] if not absent(c) and c.get("changed", True)]
    new = (cause["effect"] for cause in (*answer["causes"], *second) if absent(cause))
    unknown = float(answer.get("unknown_probability") or 0.0)
    causes = {cause["effect"]: float(cause["probability"]) for cause in fitted_causes}
    if UNKNOWN in truth.present:
        causes[UNKNOWN] = unknown
    if any(finding["name"] == PLACE for finding in answer.get("remains", ())):
        causes[PLACE] = unknown
    begun = (c for c in fitted_causes if set((c.get("onset") or {}).values()) - {None})
    shrink = answer.get("shrink") or {}
    return {
        **verdict(causes, truth, [cause["effect"] for cause in begun]),
        "parameters": {c["effect"]: c.get("parameters", {}) for c in fitted_causes},
        "unknown": unknown,
        "fraction": (shrink.get("residual") or {}).get("fraction"),
        "replay": shrink.get("replay"),
        # A wind that it, or its second answer, names in held-out flights alone.
        "new_condition": next((name for name in new if name in WINDS), ""),
        "seconds": answer.get("wall"),
    }


def verdict(causes: Mapping[str, float], truth: Truth, late: Sequence[str] = ()) -> dict[str, Any]:
    """Return the probabilities, whether all that is named is right, and names that are wrong."""
    return {
        "causes": dict(causes),
        "late": list(late),
        "parameters": {},
        "right": truth.right(causes, late),
        "wrong": truth.wrong(causes, late),
    }


# Opponent of the diagnosis: forward selection by BIC, least squares with white noise and no priors
# on the residual wrench

WRENCH = 6  # channels: force and torque in B
LENGTHS = np.geomspace(0.2, 2.0, 24)  # of payloads [m]
DAMPING = 0.1  # of payloads by the air [1/s]; as in flights of five grams
SMALL = 0.05  # displacement of a start state over length and natural rate [1]
SHARE = 0.1  # of the vehicle's mass, in units of which start states of payloads are fitted [1]
TRIED = 4  # effects a step that are fitted in full, the best at the weights so far
MOST = 10  # names that are chosen

Columns = tuple[str, np.ndarray]  # name of an effect, and its (rows, 6, k) over all flights


def library_columns(flights: Sequence[FlightResiduals]) -> list[Columns]:
    """Return the columns of the library's effects that act on the wrench, of a steady wind (a
    constant force in W, one a newton along each axis), and of payloads at the end of a tether.
    """
    library = [
        (one.identifiers[0], np.concatenate([one.columns[e.name][:, :WRENCH] for e in flights]))
        for one in library_candidates(flights)
    ]
    force = np.concatenate([e.R_WB.transpose(0, 2, 1) for e in flights])
    wind = np.concatenate([force, np.zeros_like(force)], axis=1)
    acting = [(name, X) for name, X in library if np.any(X)]
    return [*acting, *payload_columns(flights), ("constant_wind", wind)]


def payload_columns(flights: Sequence[FlightResiduals]) -> list[Columns]:
    """Return, for every tether length, the force of a payload per mass and its change with the
    start of every flight, about hanging still.
    """
    moves = np.concatenate([np.zeros((1, 4)), SMALL * np.eye(4)])
    lengths = np.repeat(LENGTHS, 5)
    states = np.tile(moves, (len(LENGTHS), 1))
    blocks = []
    for i, e in enumerate(flights):
        pull = _pulls(e, lengths, states) @ e.R_WB
        hanging_still, *moved = pull.reshape(len(e.t), len(LENGTHS), 5, 3).transpose(2, 1, 0, 3)
        X = np.zeros((len(LENGTHS), len(e.t), WRENCH, 1 + 4 * len(flights)))
        X[:, :, :3, 0] = hanging_still
        X[:, :, :3, 1 + 4 * i : 5 + 4 * i] = np.stack(moved - hanging_still, axis=-1)
        blocks.append(X)
    X = np.concatenate(blocks, axis=1)
    X[..., 1:] *= SHARE * flights[0].vehicle.mass  # start states count in products with the mass
    return [(PAYLOAD, columns) for columns in X]


def _pulls(e: FlightResiduals, lengths: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Return the pull on the vehicle per mass of m payloads on the grid, (rows, m, 3) in W [m/s²].

    The hook is at Bo. lengths: (m,) [m]. states: (m, 4) at the start, over length and natural rate
    [1].
    """
    on_grid = Signal(e.rows.t, np.concatenate([e.rows.a, e.rows.x[:, V]], axis=1)).linear(e.t)
    gravity = e.vehicle.gravity
    rate = np.sqrt(gravity / lengths)
    state = states * np.stack([lengths, lengths, lengths * rate, lengths * rate], axis=1)
    r, r_rate = hanging(state[:, :2], state[:, 2:], lengths)
    between = 0.5 * (on_grid[1:] + on_grid[:-1])
    a = between[:, :3]
    v = between[:, 3:]
    steps = swing_many(lengths, r, r_rate, a, e.grid.step, gravity, damping=DAMPING, v_hook=v)
    return np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])


def fit(y: np.ndarray, chosen: Sequence[Columns]) -> tuple[np.ndarray, float]:
    """Return the coefficients of columns that fit the residual wrench y (rows, 6), the white noise
    of every channel estimated with them, and the Bayesian information criterion.

    BIC = sum over channels of n log(RSS / n) + k log(rows * channels).
    """
    X = _joined(chosen, y)
    c = np.zeros(X.shape[2])
    weights = _weights(y)
    # Weights and coefficients in turn: iteratively reweighted least squares, which maximises the
    # likelihood of both.
    for _ in range(3):
        A, b = _scaled(X, y, weights)
        c = np.linalg.lstsq(A, b, rcond=1e-10)[0]
        weights = _weights(y - X @ c)
    used = weights > 0
    size = len(c) * math.log(len(y) * used.sum())
    return c, -2.0 * len(y) * np.sum(np.log(weights[used])) + size


def _weights(residual: np.ndarray) -> np.ndarray:
    """Return one over the RMS of each channel (6,); zero for a channel that is empty."""
    rms = np.sqrt(np.mean(residual**2, axis=0))
    return np.where(rms > 0, 1 / np.where(rms > 0, rms, 1.0), 0.0)


def _joined(chosen: Sequence[Columns], y: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros((*y.shape, 0)), *(X for _, X in chosen)], axis=2)


def _scaled(X: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return (X * weights[:, None]).reshape(y.size, X.shape[2]), (y * weights).ravel()


def select_by_bic(y: np.ndarray, columns: Sequence[Columns]) -> dict[str, float]:
    """Return the probability of every effect that forward selection by BIC chooses for the residual
    wrench y (rows, 6), in the order of choice; one of the variants of an effect is chosen at most.

    The probability is that of two models of equal prior, with and without the effect: 1 / (1 +
    exp(-change / 2)).
    """
    chosen: list[Columns] = []
    c, bic = fit(y, chosen)

    def misfit(columns: Columns) -> float:
        """Chi-squared that is left with these too at the weights so far, and a penalty of size."""
        A, b = _scaled(_joined([*chosen, columns], y), y, weights)
        c = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=1e-12)[0]
        return b @ b - c @ (A.T @ b) + A.shape[1] * math.log(len(b))

    while len(chosen) < MOST:
        taken = {name for name, _ in chosen}
        weights = _weights(y - _joined(chosen, y) @ c)
        rated = sorted((one for one in columns if one[0] not in taken), key=misfit)[:TRIED]
        fits = [(*fit(y, [*chosen, one]), one) for one in rated]
        if not fits or min(value for _, value, _ in fits) >= bic:
            break
        c, bic, best = min(fits, key=lambda fitted: fitted[1])
        chosen.append(best)
    without = {one[0]: fit(y, [o for o in chosen if o is not one])[1] for one in chosen}
    return {name: scipy.special.expit((other - bic) / 2) for name, other in without.items()}


# All cases, by method

# Thrust gained near the ground, by the height at which it was measured [m].
GAINS = {"gain_at_85_mm": 0.085, "gain_at_115_mm": 0.115}
SIZES = ["parameter", "asked", "told", "within", "covered", "error"]


def estimates(answer: Mapping[str, Any], truth: Truth) -> list[dict[str, Any]]:
    """Return a line for every parameter of the known cause: whether it is told, within what is
    asked, covered by its interval, and its error [%].
    """
    given = {n: e for name in truth.present for n, e in answer["parameters"].get(name, {}).items()}
    if "effective_radius" in given:
        given |= ground_gains(given["effective_radius"])
    lines = []
    for name, known in truth.parameters.items():
        true = known["value"]
        least, most = (true * bound for bound in known["asked"])
        estimate = given.get(name, {})
        value = estimate.get("value")
        low, high = estimate.get("ci95") or (None, None)
        lines.append(
            {
                "parameter": name,
                "asked": f"{least:.2g} to {most:.2g}",
                "told": name in given,
                "within": value is not None and least <= value <= most,
                "covered": low is not None and high is not None and low <= true <= high,
                "error": math.nan if value is None else 100 * (value / true - 1),
            }
        )
    return lines


def ground_gains(radius: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the thrust that is gained at the heights of the known parameters [1], of the effective
    radius of a ground effect [m].
    """
    gains = {}
    for name, height in GAINS.items():
        value, low, high = (
            float(GroundEffect(r).gain(np.array(height)))
            for r in (radius["value"], *radius["ci95"])
        )
        gains[name] = {"value": value, "ci95": [low, high]}
    return gains


def outcome(record: Mapping[str, Any], by: str) -> dict[str, Any]:
    """Return all that counts of a method in a case; None where it does not count."""
    method = record["methods"][by]
    campaign = campaign_of(record["group"])
    truth = campaign.truth
    causes = method["causes"]
    wind = method.get("wind", {})
    names = set(campaigns.named(causes))
    sizes = estimates(method, truth)
    within = {line["parameter"]: line["within"] for line in sizes}
    fans = record.get("wind")
    near = {
        figure: figure in wind and abs(wind[figure] - about) <= most
        for figure, (about, most) in WITHIN.items()
        if fans and (figure != "speed" or fans <= GENTLE)
    }
    gained = method.get("fraction")
    judged = [(name, p, truth.holds(name, method["late"])) for name, p in causes.items()]
    return {
        "group": record["group"],
        "case": record["case"],
        "by": by,
        "healthy": truth.healthy,
        "since": bool(campaign.before),
        "right": method["right"],
        "false": bool(method["wrong"]),
        "beyond": len(names - {DRAG, "quadratic_drag", PLACE, UNKNOWN}),
        "worse": None if gained is None else bool(gained < 0 and names),
        "unknown": None if by == BIC else method["unknown"] > campaigns.NAMED,
        "payload": PAYLOAD in names,
        **within,
        "covered": all(line["covered"] for line in sizes) if sizes else None,
        "ground": GROUND in names and all(within.get(name, False) for name in GAINS),
        "blown": DRAG in names and bool(names & set(WINDS)) and not names & BESIDE_WIND,
        **near,
        "new": None if by == BIC else bool(method["new_condition"]),
        "sure": sum(causes[name] > SURE for name in method["wrong"]),
        "judged": judged,
        "seconds": method.get("seconds"),
        "replay": _replay_errors(method.get("replay") or {}),
        "sizes": sizes,
        "names": _names(judged),
    }


def _replay_errors(replay: Mapping[str, Any]) -> dict[str, float]:
    """Return the position errors of the replay before and after, by horizon [cm]."""
    return {
        f"{horizon:g} s {when}": 100 * replay[when]["position"][k]
        for k, horizon in enumerate(replay.get("horizon", ()))
        for when in ("before", "after")
        if replay.get(when)
    }


def _names(judged: Sequence[tuple[str, float, bool | None]]) -> str:
    """Return the most probable names with their probabilities, wrong ones in capitals."""
    shown = [
        f"{name.upper() if right is False else name} {p:.2f}"
        for name, p, right in sorted(judged, key=lambda name: -name[1])
    ]
    more = [f"and {len(shown) - TOP} more"] if len(shown) > TOP else []
    return ", ".join([*shown[:TOP], *more]) or "nothing"


def calibrations(rows: pd.DataFrame) -> dict[str, list[dict[str, Any]]]:
    """Return the calibration of names by method, by bin of probability."""
    return {
        by: calibration(of["judged"], **campaigns.BINS)["bins"]
        for by, of in rows.groupby("by", sort=False)
    }


def outcomes(records: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Return a row for every case and method."""
    return pd.DataFrame(
        [outcome(record, by) for by in (THIS, BIC) for record in records if by in record["methods"]]
    )


def asked_figures(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Return lines with what is asked, what is wanted, and what each method gives, where one gives
    anything.
    """
    lines = []
    for line in campaigns.ASKED:
        column = line["column"]
        counted = rows.query(campaigns.CASES.get(line["of"], f"group == '{line['of']}'"))
        if column in counted and counted[column].notna().any():
            known = counted.dropna(subset=column).groupby("by", sort=False)
            figures = {by: aggregate(of, line) for by, of in known}
            text = line.get("text")
            cells = {by: text.format(figure) if text else figure for by, figure in figures.items()}
            lines.append({"asked": line["asked"], "wanted": line["wanted"], **cells})
    return lines


def tables(rows: pd.DataFrame) -> list[Table]:
    """Return all tables that the cases give, what is asked first, the names of every case last."""
    counts = ["right", "false", "beyond", "worse", "unknown"]
    keys = ["group", "by"]
    cases = rows.groupby(keys, sort=False)
    groups = cases.size().to_frame("n").join(cases[counts].sum(min_count=1))
    groups = groups.join(cases["seconds"].agg(["median", "max"]))
    sizes = listed(rows, "sizes", SIZES).query("told")
    by_parameter = sizes.groupby(["group", "parameter", "asked", "by"], sort=False)
    parameters = by_parameter[["told", "within", "covered"]].sum()
    parameters = parameters.join(by_parameter["error"].agg(["median", "min", "max"]))
    flown = pd.DataFrame(rows["replay"].tolist(), index=rows.index).join(rows[keys])
    replays = flown.groupby(keys, sort=False).median().dropna(how="all")
    bins = [{"by": by, **row} for by, of in calibrations(rows).items() for row in of]
    judged = pd.DataFrame(bins, columns=["by", "lower", "upper", "n", "mean", "rate"])
    names = rows.assign(case=rows["group"] + ": " + rows["case"])[["case", "by", "names"]]
    return [
        *table("asked of the diagnosis; BIC: forward selection", asked_figures(rows)),
        *table(
            "cases: known cause named and no false name; with a false name; names beyond drag; "
            "named, and held out worse; unknown; seconds, median and most",
            groups.reset_index(),
        ),
        *table(
            "parameters of known causes [SI]: told, within what is asked, covered by the 95 % "
            "interval; error: median and range [%]",
            parameters.reset_index(),
        ),
        *table("position error of the replay, median over cases [cm]", replays.reset_index()),
        *table("names of which the truth is known, by reported probability", judged),
        *table(
            f"names and probabilities, the first {TOP}; WRONG ones in capitals, those above "
            f"{campaigns.NAMED:g} count",
            names,
        ),
    ]


# The study


def run(
    run: Run,
    folder: RealFlights = None,
    neurobem: Neurobem = None,
    only: Group = None,
    answers: Annotated[
        Path | None,
        Option(
            "--answers",
            metavar="DIR",
            help=f"Score DIR/<group>/<case>/{ANSWER_FILE} of any tool; nothing is diagnosed.",
        ),
    ] = None,
    replay: Annotated[
        bool,
        Option("--replay", help="Replay held-out flights in the nominal and corrected simulator."),
    ] = False,
) -> Report:
    """The diagnosis, or answers of any tool, on real flights with known causes, beside least
    squares.
    """
    folder = required("real", folder, REAL_FLIGHTS)
    cases = campaigns.make_cases(folder, neurobem, only or ())
    lost = [
        case.folder / ANSWER_FILE
        for case in cases
        if answers and read_answer(answers / case.folder / ANSWER_FILE, REAL_ANSWER) is None
    ]
    if len(lost) == len(cases):
        raise ValueError(
            f"--answers: {answers} must hold <group>/<case>/{ANSWER_FILE}, as {lost[0]}; got none."
        )
    for case in cases:  # before the long work
        for path in (*case.train, case.held_out, *case.still, *case.before):
            campaign_of(case.group).open_flights(path)
    config: dict[str, Any] = {
        "folder": folder,
        "neurobem": neurobem,
        "only": only,
        "replay": replay,
    }
    if answers is not None:  # their content, so that others are not taken for them
        files = sorted(answers.rglob(ANSWER_FILE))
        config["answers"] = joblib.hash(
            [(str(f.relative_to(answers)), f.read_bytes()) for f in files]
        )
    work = partial(
        score_case,
        folder=folder.resolve(),
        neurobem=neurobem and neurobem.resolve(),
        answers=answers and answers.resolve(),
        replay=replay,
    )
    finished = run.cases(
        "diagnosing" if answers is None else "scoring",
        "cases",
        work,
        [{"group": case.group, "name": case.name} for case in cases],
        config=config,
    )
    failed = failures(finished)
    scores = [(case, r["result"]) for case, r in zip(cases, finished, strict=True) if "result" in r]
    made = {case.folder: result.pop("answer") for case, result in scores if "answer" in result}
    records = [result for _, result in scores]
    rows = outcomes(records)
    bins = calibrations(rows) if records else {}

    def write(out: Path) -> None:
        for case_folder, answer in made.items():
            (out / "answers" / case_folder).mkdir(parents=True, exist_ok=True)
            write_json(out / "answers" / case_folder / ANSWER_FILE, answer)

    return Report(
        tables(rows) if records else [],
        config={**config, "cases": [f"{case.group}: {case.name}" for case in cases]},
        metrics={"table": records, "calibration": bins, "failures": failed},
        summary=[f"{len(records)} cases, by this rule:", *campaigns.RULE],
        notes=[f"{len(lost)} of {len(cases)} cases have no answer; the first: {lost[0]}"]
        if lost
        else [],
        figures={"calibration.png": lambda: calibration_figure(bins)} if any(bins.values()) else {},
        write=write if made else None,
        failure=FailedRun(f"{failed[0]} ({len(failed)} of {len(cases)} cases failed)")
        if failed
        else None,
    )
