"""Score of one case: every method's names against the truth, its parameters, and what its model
predicts.
"""

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.real.answers import brief, effects_of, read_answer
from diagrams.challenge.real.campaigns import campaign_of
from diagrams.challenge.real.effect_columns import (
    DAMPING,
    LENGTHS,
    library_columns,
    payload_columns,
    wind_columns,
)
from diagrams.challenge.real.flights import open_case, open_flights
from diagrams.challenge.real.least_squares import (
    select_by_bic,
    told_ground,
    told_payload,
    told_wind,
)
from diagrams.challenge.real.payload_position import (
    observed,
    open_loop,
    position_errors,
    residual_force,
    wrench_of,
)
from diagrams.challenge.real.rules import Case
from diagrams.challenge.real.truth import DIRECTION, GROUND, PAYLOAD, PLACE, WINDS, Truth
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.diagnosis.result import UNKNOWN
from np_drake.effects.base import Effect, WrenchEffect
from np_drake.effects.combine import split_effects
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

STEP = 0.02  # between the instants at which a force is averaged [s]


def measured_wind_force(case: Case, windy: Sequence[FlightLog]) -> np.ndarray:
    """Return the mean residual force of flights in wind less that of flights in still air, (3,) in
    W [N].
    """
    campaign = campaign_of(case.group)

    def mean(flights: Sequence[FlightLog]) -> np.ndarray:
        forces = [residual_force(make_flight_residuals(log, campaign.nominal)) for log in flights]
        return np.mean([force.mean(axis=0) for force in forces], axis=0)

    return mean(windy) - mean([log for path in case.still for log in open_flights(path, campaign)])


def wind_figures(
    effects: Sequence[Effect],
    flights: Sequence[FlightLog],
    vehicle: Vehicle,
    measured: np.ndarray,
    speed: float,
    force: np.ndarray | None = None,
) -> dict[str, float]:
    """Return direction error [deg], mean force over that measured [1] and speed over that of the
    fans [1] of a wind.

    Empty where no wind is among the effects.

    Args:
        flights: flights in the wind, over which its force is averaged.
        measured: (3,) mean force of the wind in W [N].
        speed: of the fans [m/s].
        force: (3,) mean force of the wind in W, where it is known [N]; None: that of the effects.
    """
    acting = split_effects(effects).wrench
    winds: list[Any] = [effect.predicted for effect in acting if effect.identifier in WINDS]
    if not winds:
        return {}
    if force is None:
        drags = [effect for effect in acting if effect.identifier not in WINDS]
        force = np.mean([_wind_force(log, vehicle, drags, winds) for log in flights], axis=0)
    wind = sum((w.air_velocity(0.0) for w in winds), np.zeros(3))
    return {
        "angle": angle(wind[:2], np.array(DIRECTION)),
        "force": float(force[:2] @ DIRECTION / (measured[:2] @ DIRECTION)),
        "speed": float(np.linalg.norm(wind[:2]) / speed),
        "up": float(wind[2]),
    }


def _wind_force(
    log: FlightLog, vehicle: Vehicle, drags: Sequence[WrenchEffect], winds: Sequence[WrenchEffect]
) -> np.ndarray:
    """Return the mean force of drags in wind less that of drags in still air, (3,) in W [N]."""
    t = log.t[:: max(1, int(STEP / log.step))]
    change = wrench_of(log, vehicle, [*drags, *winds], t) - wrench_of(log, vehicle, drags, t)
    return change[:, :3].mean(axis=0)


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [deg]; NaN where one is zero."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.degrees(math.acos(np.clip(float(a @ b) / size, -1, 1))) if size > 0 else math.nan


THIS, BIC, TOLD = "this", "BIC", "told"
BASELINES = (BIC, TOLD)  # methods that give no diagnosis.json
AXES = {
    "lateral": ("x", "y"),
    "vertical": ("z",),
    "torque": ("x", "y", "z"),
}  # of the held-out residual
PREDICTORS = {"open": open_loop, "observed": observed}  # of the payload's position


@dc.dataclass(frozen=True)
class Scoring:
    """Work of a case -> {"group", "vehicle", "case", "methods", "answer"}: the score of every
    method.

    answers: folder of answers to score; None: the case is diagnosed, and "answer" holds what was
    said.
    beside: further folders of answers, by name.
    A case that a folder does not answer lacks that method.
    """

    answers: Path | None = None
    beside: Mapping[str, Path] = dc.field(default_factory=dict)

    def __call__(self, case: Case) -> dict[str, Any]:
        """Return names, right, wrong, parameters, held-out figures and seconds of every method.

        Raises: LogError, OSError: if a flight cannot be used; ValueError: if an answer is none.
        """
        campaign, (vehicle, train, held_out) = campaign_of(case.group), open_case(case)
        flights, truth = [make_flight_residuals(log, vehicle) for log in train], campaign.truth
        record: dict[str, Any] = {
            "group": case.group,
            "vehicle": campaign.vehicle,
            "case": case.name,
        }
        record |= {"wind": case.speed} if case.speed else {}
        folders = {THIS: self.answers, **self.beside}
        said = {
            name: read_answer(folder, case)
            for name, folder in folders.items()
            if folder is not None
        }
        if self.answers is None:
            found = diagnose(vehicle, train, held_out, adaptive_split=case.second)
            record["answer"] = said[THIS] = brief(found.as_json())
        methods: dict[str, Any] = {
            name: scored(answer, truth, train)
            for name, answer in said.items()
            if answer is not None
        }
        effects = {
            name: effects_of(said[name] or {}, own["causes"]) for name, own in methods.items()
        }
        columns = [
            *library_columns(flights),
            *payload_columns(flights, LENGTHS),
            wind_columns(flights),
        ]
        methods[BIC] = {**verdict(select_by_bic(flights, columns), truth), "parameters": {}}
        if PAYLOAD in truth.present:
            own = told_payload(flights)
            effects[TOLD] = [
                SuspendedPayload(
                    own["mass"]["value"], own["length"]["value"], 0.0, 0.0, 0.0, DAMPING
                )
            ]
            methods[TOLD] = {"causes": {}, "parameters": {PAYLOAD: own}}
            for name, acting in effects.items():
                methods[name]["position"] = position_errors(
                    case.held_out, held_out, vehicle, acting, PREDICTORS
                )
        if GROUND in truth.present:
            methods[TOLD] = {"causes": {}, "parameters": {GROUND: told_ground(flights)}}
        if case.still:
            record["force"] = measured_wind_force(case, train).tolist()
            fans = (train, vehicle, np.array(record["force"]), case.speed)
            for name, acting in effects.items():
                methods[name]["wind"] = wind_figures(acting, *fans)
            drag, wind, force = told_wind(flights)
            methods[TOLD] = {
                "causes": {},
                "parameters": {},
                "wind": wind_figures([drag, wind], *fans, force),
            }
        return record | {"methods": methods}


def scored(
    answer: Mapping[str, Any], truth: Truth, train: Sequence[FlightLog] = ()
) -> dict[str, Any]:
    """Return what the content of a `diagnosis.json` says, against the truth.

    A cause that is absent from all flights of the fit is said of the held-out flight, and is not
    judged as theirs.

    Args:
        answer: content of `diagnosis.json`.
        train: flights of the fit; empty: every cause is theirs.
    """
    fitted = {log.name for log in train}
    own = [
        c for c in answer["causes"] if not fitted or not fitted <= set(c.get("absent_from") or ())
    ]
    causes = {c["effect"]: float(c["probability"]) for c in own}
    unknown = float(answer.get("unknown_probability") or 0.0)
    if UNKNOWN in truth.present:
        causes[UNKNOWN] = unknown
    if any(finding["name"] == PLACE for finding in answer.get("remains", ())):
        causes[PLACE] = unknown
    late = [
        c["effect"]
        for c in own
        if any(time is not None for time in (c.get("onset") or {}).values())
    ]
    return {
        **verdict(causes, truth, late),
        "parameters": {c["effect"]: c.get("parameters", {}) for c in own},
        "unknown": unknown,
        "cut": held_out_cut(answer.get("gap") or {}),
        "fraction": ((answer.get("shrink") or {}).get("residual") or {}).get("fraction"),
        "new_condition": says_new_condition(answer, fitted),
        "seconds": answer.get("wall"),
    }


def verdict(causes: Mapping[str, float], truth: Truth, late: Sequence[str] = ()) -> dict[str, Any]:
    """Return the probabilities, whether all that is named is right, and the names that are wrong.

    Args:
        causes: probability by name [1].
    """
    right, wrong = truth.right(causes, late), truth.wrong(causes, late)
    return {"causes": dict(causes), "late": list(late), "right": right, "wrong": wrong}


def held_out_cut(gap: Mapping[str, Any]) -> dict[str, float | None]:
    """Return by how much the causes reduce the RMS of the held-out residual, by group of channels
    [1].
    """
    cut: dict[str, float | None] = {}
    for group, axes in AXES.items():
        kind = gap.get("torque" if group == "torque" else "force") or {}
        before, after = (
            math.sqrt(sum((kind.get(axis, {}).get(key) or 0.0) ** 2 for axis in axes))
            for key in ("rms", "after")
        )
        cut[group] = 1 - after / before if before > 0 else None
    return cut


def says_new_condition(answer: Mapping[str, Any], fitted: set[str]) -> str:
    """Return the wind that an answer, or its second answer, finds in held-out flights alone; empty
    where there is none.

    Args:
        answer: content of `diagnosis.json`.
    """
    causes = [*answer["causes"], *(answer.get("refit") or {}).get("causes", ())]
    new = (c["effect"] for c in causes if fitted and fitted <= set(c.get("absent_from") or ()))
    return next((name for name in new if name in WINDS), "")
