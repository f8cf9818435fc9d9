"""One vehicle: flown, diagnosed, flown again as each arm would, until one explanation stands."""

import dataclasses as dc
from collections.abc import Sequence
from typing import Any

from diagrams.batch.campaign import Case as CampaignCase
from diagrams.batch.failed_run import FailedRun, one_line
from diagrams.challenge.active.answer import Answer, answer_of
from diagrams.challenge.active.flown import FITTED, FURTHER, HELD_OUT, RealFlight, fly_real
from diagrams.challenge.active.next_motion import NextMotion, Room, next_motion
from diagrams.challenge.active.start import STARTS, Start, withheld_case
from diagrams.challenge.generate.case import Case
from diagrams.challenge.generate.ground_truth import residual_and_visibility, visibility_of_each
from diagrams.challenge.simulators.flight_plan import Plan

MOST_DRAWS = 100  # of a vehicle, before a case fails
FLOWN, NO_MOTION, LOST, NO_ANSWER = "flown", "no motion", "lost", "no answer"  # outcomes of a further flight


@dc.dataclass(frozen=True)
class Begun:
    """A case after its first flights.

    answer: None where they cannot be diagnosed, for the reason `failed`.   draws: of vehicles.   lost: of these, on
    the first flights.
    """

    case: Case
    kind: str
    fitted: RealFlight
    held_out: RealFlight
    answer: Answer | None
    failed: str
    draws: int
    lost: int


@dc.dataclass(frozen=True)
class ActiveDiagnosis:
    """Work of a case {"seed"} -> what withheld effects, the first flights and every arm gave.

    start: name of `STARTS`.   arms: of `next_motion.ARMS`.   flights: most further flights.   room: for these.
    """

    start: str
    arms: tuple[str, ...]
    flights: int
    room: Room

    def __call__(self, case: CampaignCase) -> dict[str, Any]:
        """Return the record of a case; what fails on the way is an outcome in it.

        Raises: FailedRun: if no vehicle can be drawn that the start asks for.
        """
        seed = case["seed"]
        begun = begin(seed, STARTS[self.start])
        noise, visibility = residual_and_visibility(begun.case, begun.held_out.pair)
        first = (
            {"outcome": FLOWN, **begun.answer.record()} if begun.answer else failed(NO_ANSWER, begun.failed)
        )
        return {
            "withheld": [{"effect": e.identifier, "parameters": e.values} for e in begun.case.effects],
            "kind": begun.case.draw.kind,
            "vehicle": begun.case.vehicle.name,
            "flight": begun.kind,
            "draws": begun.draws,
            "lost_draws": begun.lost,
            "visibility": visibility,
            "visibility_of_each": visibility_of_each(begun.case, begun.held_out.pair, noise),
            "first": first,
            "arms": {arm: self.arm(arm, begun, seed) for arm in self.arms},
        }

    def arm(self, arm: str, begun: Begun, seed: int) -> list[dict[str, Any]]:
        """Return a record of every further flight of an arm; none where one explanation stands already."""
        steps: list[dict[str, Any]] = []
        fitted, answer = [begun.fitted], begun.answer
        while answer is not None and not answer.settled and len(steps) < self.flights:
            step, answer = self.further(arm, answer, fitted, begun.held_out, seed + len(steps))
            steps.append(step)
        return steps

    def further(
        self, arm: str, answer: Answer, fitted: list[RealFlight], held_out: RealFlight, seed: int
    ) -> tuple[dict[str, Any], Answer | None]:
        """Fly once more: return the record, and the answer with this flight, which `fitted` then holds.

        The answer is None where the arm ends, for no motion keeps the limits, the vehicle is lost, or the diagnosis
        fails.
        """
        try:
            motion = next_motion(arm, answer, self.room, seed)
        except ValueError as error:
            return failed(NO_MOTION, one_line(error)), None
        told = motion_record(motion)
        number = FURTHER + len(fitted) - 1
        try:
            flight = fly_real(answer.case, Plan(motion.name, motion.reference), number, self.room.seconds)
        except FailedRun as error:
            return {**failed(LOST, one_line(error)), **told}, None
        fitted.append(flight)
        told["usage"] = flight.usage(motion.limits)
        found, why = diagnosed(answer.case, fitted, held_out)
        if found is None:
            return {**failed(NO_ANSWER, why), **told}, None
        return {"outcome": FLOWN, **told, **found.record()}, found


def begin(seed: int, start: Start) -> Begun:
    """Return a vehicle after its first flights, drawn until these are flown and, if asked for, ambiguous.

    Raises: FailedRun: if `MOST_DRAWS` draws give none.
    """
    lost = 0
    for attempt in range(MOST_DRAWS):
        case = withheld_case(seed, attempt)
        fit, hold = start.plans(case)
        try:
            fitted = fly_real(case, fit, FITTED, start.fitted)
            held_out = fly_real(case, hold, HELD_OUT, start.held_out)
        except FailedRun:
            lost += 1
            continue
        answer, why = diagnosed(case, [fitted], held_out)
        if start.ambiguous and (answer is None or len(answer.standing) < 2):
            continue
        return Begun(case, fit.kind, fitted, held_out, answer, why, attempt + 1, lost)
    raise FailedRun(f"active: no vehicle of seed {seed} in {MOST_DRAWS} draws begins as it is asked to.")


def diagnosed(case: Case, fitted: Sequence[RealFlight], held_out: RealFlight) -> tuple[Answer | None, str]:
    """Return the answer of flights; None and the reason where their diagnosis fails, whatever the error."""
    try:
        return answer_of(case, fitted, held_out), ""
    except Exception as error:
        return None, one_line(error)


def failed(outcome: str, why: str) -> dict[str, Any]:
    """Return the record of a flight that gave no answer."""
    return {"outcome": outcome, "why": why}


def motion_record(motion: NextMotion) -> dict[str, Any]:
    """Return what is known of a motion before its flight."""
    return {
        "motion": motion.name,
        "design_seconds": motion.design,
        "simulated": motion.simulated,
        "expected_entropy": motion.entropy,
    }
