"""Score of one case: every method's names against the truth, its parameters, and what its model predicts."""

import dataclasses as dc
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.challenge.real.cases import Case, cases_by_name
from diagrams.challenge.real.flights import open_case
from diagrams.challenge.real.least_squares import (
    DAMPING,
    LENGTHS,
    library_columns,
    payload_columns,
    residuals_of,
    select_by_bic,
    told_payload,
    told_wind,
    wind_columns,
)
from diagrams.challenge.real.logged_payload import logged_payload
from diagrams.challenge.real.payload_position import error, make_drive, observed, open_loop
from diagrams.challenge.real.truth import DIRECTION, TRUTHS, WINDS, Truth
from diagrams.challenge.real.wind_force import (
    measured_wind_force,
    steady_wind,
    told_wind_force,
    wrench_effects,
)
from np_drake.diagnosis.diagnose import diagnose
from np_drake.effects.pendulum import Payload
from np_drake.flight_log import FlightLog
from np_drake.vehicle import Vehicle

THIS, BIC, TOLD = "this", "BIC", "told"
METHODS = (THIS, BIC, TOLD)
GROUPS = {
    "lateral": ("x", "y"),
    "vertical": ("z",),
    "torque": ("x", "y", "z"),
}  # axes of the held-out residual
Causes = Mapping[str, float]  # probability by name


@dc.dataclass(frozen=True)
class Scoring:
    """Work of a case {"group", "name"} -> `score_case`.

    folder, neurobem: of the real flights, under the same path for all workers.
    """

    folder: Path
    neurobem: Path | None

    def __call__(self, record: dict[str, Any]) -> dict[str, Any]:
        """Score the case."""
        return score_case(cases_by_name(self.folder, self.neurobem)[record["group"], record["name"]])


def score_case(case: Case) -> dict[str, Any]:
    """Return a case with the score of every method: names, right, wrong, parameters, held-out figures and seconds.

    Raises: LogError, OSError: if a flight cannot be used.
    """
    vehicle, train, held_out = open_case(case)
    truth = TRUTHS[case.group]
    answer = diagnose(vehicle, train, held_out, adaptive_split=case.second).as_json()
    methods = {THIS: scored(answer, truth, train), **_opponents(vehicle, train, truth)}
    for method in methods.values():
        if "payload" in case.group and "suspended_payload" in method["parameters"]:
            method["position"] = position_errors(case, vehicle, held_out, method)
    record: dict[str, Any] = {"group": case.group, "case": case.name, "methods": methods}
    if case.group == "wind":
        force = measured_wind_force(case.train, case.still, vehicle)
        record |= {"wind": case.speed, "force": force.tolist()}
        for method in methods.values():
            method["wind"] = wind_figures(method["parameters"], train, vehicle, force, case.speed)
    return record


def scored(answer: Mapping[str, Any], truth: Truth, train: Sequence[FlightLog] = ()) -> dict[str, Any]:
    """Return what the content of a `diagnosis.json` says, against the truth.

    A cause that is absent from all flights of the fit is said of the held-out flight, and is not judged as theirs.
    """
    fitted = {log.name for log in train}
    own = [c for c in answer["causes"] if not fitted or not fitted <= set(c.get("absent_from") or ())]
    causes = {c["effect"]: float(c["probability"]) for c in own}
    return {
        **verdict(causes, truth),
        "parameters": {c["effect"]: c["parameters"] for c in own},
        "unknown": answer.get("unknown_probability", 0.0),
        "cut": held_out_cut(answer["gap"]),
        "new_condition": says_new_condition(answer, fitted),
        "seconds": answer["wall"],
    }


def verdict(causes: Causes, truth: Truth) -> dict[str, Any]:
    """Return the probabilities, whether all that is named is right, and the names that are wrong."""
    return {"causes": dict(causes), "right": truth.right(causes), "wrong": truth.wrong(causes)}


def held_out_cut(gap: Mapping[str, Any]) -> dict[str, float | None]:
    """Return by how much the causes reduce the RMS of the held-out residual, by group of channels [1]."""
    cut: dict[str, float | None] = {}
    for group, axes in GROUPS.items():
        kind = gap.get("torque" if group == "torque" else "force") or {}
        before, after = (
            math.sqrt(sum((kind.get(axis, {}).get(key) or 0.0) ** 2 for axis in axes))
            for key in ("rms", "after")
        )
        cut[group] = 1 - after / before if before > 0 else None
    return cut


def says_new_condition(answer: Mapping[str, Any], fitted: set[str]) -> str:
    """Return the wind that an answer, or its second answer, finds in held-out flights alone; empty where there is none.

    Args: fitted: names of the flights of the fit.
    """
    causes = [*answer["causes"], *(answer.get("refit") or {}).get("causes", ())]
    new = (c["effect"] for c in causes if fitted and fitted <= set(c.get("absent_from") or ()))
    return next((name for name in new if name in WINDS), "")


def position_errors(
    case: Case, vehicle: Vehicle, held_out: Sequence[FlightLog], method: Mapping[str, Any]
) -> dict[str, float]:
    """Return the RMSE of the payload's position on the held-out flight, open loop and observed [m]."""
    values = values_of(method["parameters"])
    own = values["suspended_payload"]
    hook = tuple(own.get(f"hook_{axis}", 0.0) for axis in "xyz")
    damping = own.get("damping", DAMPING)  # an answer without one: that of least squares
    payload = Payload(own["mass"], own["length"], hook, damping)  # type: ignore[arg-type]
    if payload.mass <= 0:
        return {}
    found: dict[str, list[float]] = {"open": [], "observed": []}
    for log in held_out:
        t, p = logged_payload(case.held_out, log)
        drive = make_drive(log, vehicle, payload, wrench_effects(values))
        for name, predict in (("open", open_loop), ("observed", observed)):
            found[name].append(error(predict(drive, payload, vehicle.gravity), drive.t, p, t))
    return {name: float(np.sqrt(np.mean(np.square(errors)))) for name, errors in found.items()}


def wind_figures(
    parameters: Mapping[str, Mapping[str, Any]],
    train: Sequence[FlightLog],
    vehicle: Vehicle,
    force: np.ndarray,
    speed: float,
) -> dict[str, float]:
    """Return direction error [deg], mean force over that measured [1] and speed over that of the fans [1] of a wind.

    Empty where no wind is named.
    """
    values = values_of(parameters)
    wind = steady_wind(values)
    if wind is None:
        return {}
    told = parameters.get("wind force")
    along = np.array(told["xyz"]["value"]) if told else told_wind_force(values, train, vehicle)
    return {
        "angle": angle(wind[:2], np.array(DIRECTION)),
        "force": float(along[:2] @ DIRECTION / (force[:2] @ DIRECTION)),
        "speed": float(np.linalg.norm(wind[:2]) / speed),
        "up": float(wind[2]),
    }


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [deg]."""
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return math.degrees(math.acos(np.clip(float(a @ b) / size, -1, 1))) if size > 0 else math.nan


def values_of(parameters: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Return the values of parameters by effect, without units and intervals."""
    return {
        effect: {name: e["value"] for name, e in own.items() if isinstance(e["value"], float | int)}
        for effect, own in parameters.items()
    }


def _opponents(vehicle: Vehicle, train: Sequence[FlightLog], truth: Truth) -> dict[str, dict[str, Any]]:
    """Return the scores of least squares, that chooses by BIC and that is told the effect."""
    flights = residuals_of(train, vehicle)
    columns = [
        *library_columns(flights),
        *payload_columns(flights, vehicle, LENGTHS),
        wind_columns(flights, vehicle),
    ]
    found = {BIC: {**verdict(select_by_bic(flights, columns), truth), "parameters": {}}}
    if "suspended_payload" in truth.present:
        found[TOLD] = {"causes": {}, "parameters": {"suspended_payload": told_payload(flights, vehicle)}}
    if set(WINDS) & set(truth.present):
        found[TOLD] = {"causes": {}, "parameters": told_wind(flights, vehicle)}
    return found
