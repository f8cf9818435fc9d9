"""Score of one case: every method's names against the truth, its parameters, and what its model predicts."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from diagrams.challenge.real.cases import Case
from diagrams.challenge.real.effect_columns import DAMPING, LENGTHS, library_columns, payload_columns, wind_columns
from diagrams.challenge.real.flights import open_case
from diagrams.challenge.real.least_squares import select_by_bic, told_payload, told_wind
from diagrams.challenge.real.payload_position import observed, open_loop, position_errors
from diagrams.challenge.real.truth import TRUTHS, WINDS, Truth
from diagrams.challenge.real.wind_force import measured_wind_force, wind_figures
from np_drake.diagnosis.diagnose import diagnose
from np_drake.diagnosis.residuals.make_flight_residuals import make_flight_residuals
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_log import FlightLog

THIS, BIC, TOLD = "this", "BIC", "told"
METHODS = (THIS, BIC, TOLD)
GROUPS = {"lateral": ("x", "y"), "vertical": ("z",), "torque": ("x", "y", "z")}  # axes of the held-out residual
PREDICTORS = {"open": open_loop, "observed": observed}  # of the payload's position


def score_case(case: Case) -> dict[str, Any]:
    """Return a case with the score of every method: names, right, wrong, parameters, held-out figures and seconds.

    Raises: LogError, OSError: if a flight cannot be used.
    """
    vehicle, train, held_out = open_case(case)
    truth, flights = TRUTHS[case.group], [make_flight_residuals(log, vehicle) for log in train]
    found = diagnose(vehicle, train, held_out, adaptive_split=case.second)
    this = scored(found.as_json(), truth, train)
    effects = [c.effect for c in found.causes if c.effect is not None and c.identifier in this["causes"]]
    columns = [*library_columns(flights), *payload_columns(flights, LENGTHS), wind_columns(flights)]
    bic = {**verdict(select_by_bic(flights, columns), truth), "parameters": {}}
    record: dict[str, Any] = {"group": case.group, "case": case.name, "methods": {THIS: this, BIC: bic}}
    if "suspended_payload" in truth.present:
        own = told_payload(flights)
        told: dict[str, Any] = {"causes": {}, "parameters": {"suspended_payload": own}}
        pendulum = SuspendedPayload(own["mass"]["value"], own["length"]["value"], 0.0, 0.0, 0.0, DAMPING)
        for method, acting in ((this, effects), (told, [pendulum])):
            method["position"] = position_errors(case.held_out, held_out, vehicle, acting, PREDICTORS)
        record["methods"][TOLD] = told
    if case.group == "wind":
        measured = measured_wind_force(case.train, case.still, vehicle)
        drag, wind, force = told_wind(flights)
        fans = (train, vehicle, measured, case.speed)
        this["wind"] = wind_figures(effects, *fans)
        told = {"causes": {}, "parameters": {}, "wind": wind_figures([drag, wind], *fans, force)}
        record["methods"][TOLD] = told
        record |= {"wind": case.speed, "force": measured.tolist()}
    return record


def scored(answer: Mapping[str, Any], truth: Truth, train: Sequence[FlightLog] = ()) -> dict[str, Any]:
    """Return what the content of a `diagnosis.json` says, against the truth.

    A cause that is absent from all flights of the fit is said of the held-out flight, and is not judged as theirs.

    Args:
        answer: content of `diagnosis.json`.
        truth: of the flights.
        train: flights of the fit; empty: every cause is theirs.
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


def verdict(causes: Mapping[str, float], truth: Truth) -> dict[str, Any]:
    """Return the probabilities, whether all that is named is right, and the names that are wrong.

    Args:
        causes: probability by name [1].
        truth: of the flights.
    """
    return {"causes": dict(causes), "right": truth.right(causes), "wrong": truth.wrong(causes)}


def held_out_cut(gap: Mapping[str, Any]) -> dict[str, float | None]:
    """Return by how much the causes reduce the RMS of the held-out residual, by group of channels [1]."""
    cut: dict[str, float | None] = {}
    for group, axes in GROUPS.items():
        kind = gap.get("torque" if group == "torque" else "force") or {}
        before, after = (
            math.sqrt(sum((kind.get(axis, {}).get(key) or 0.0) ** 2 for axis in axes)) for key in ("rms", "after")
        )
        cut[group] = 1 - after / before if before > 0 else None
    return cut


def says_new_condition(answer: Mapping[str, Any], fitted: set[str]) -> str:
    """Return the wind that an answer, or its second answer, finds in held-out flights alone; empty where there is none.

    Args:
        answer: content of `diagnosis.json`.
        fitted: names of the flights of the fit.
    """
    causes = [*answer["causes"], *(answer.get("refit") or {}).get("causes", ())]
    new = (c["effect"] for c in causes if fitted and fitted <= set(c.get("absent_from") or ()))
    return next((name for name in new if name in WINDS), "")
