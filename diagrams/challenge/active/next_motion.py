"""The motion that an arm of the loop flies next: the designed one, or a naive manoeuvre of the same length."""

import dataclasses as dc
import time

import numpy as np

from diagrams.batch.failed_run import FailedRun
from diagrams.challenge.active.answer import Answer
from diagrams.challenge.simulators.drake.simulator import fly_true
from diagrams.challenge.simulators.flight_plan import Plan
from diagrams.gap.flown_design import Flown, keep_limits, usage_of
from np_drake.effects.explanation import Explanation
from np_drake.flight_design.design import DESIGNED, EVALUATIONS, SHARE, Candidate, FlightDesigner
from np_drake.flight_design.limits import Limits, limits_for
from np_drake.flight_design.motion import Basis
from np_drake.flight_design.naive import NAIVE, naive_motions
from np_drake.references.base import Reference
from np_drake.vehicle import Vehicle

ARMS = (DESIGNED, *NAIVE)
CONTROLLER = "cascade"  # of the challenge
RATE = 100.0  # of the flights in the simulator [Hz]
BLIND = "random"  # naive motion that is flown where the flights so far tell no explanation


@dc.dataclass(frozen=True)
class Room:
    """What a further flight may use.

    box: size along x, y, z, its floor at z = 0 [m].   seconds: of a flight [s].   speed: [m/s].   tilt: [rad].
    evaluations: budget of a search [1].
    """

    box: tuple[float, float, float] = (4.0, 4.0, 2.5)
    seconds: float = 20.0
    speed: float = 3.0
    tilt: float = 0.5
    evaluations: int = EVALUATIONS

    def check(self) -> "Room":
        """Return this room.

        Raises: ValueError: if it is too small, or a limit is impossible; one line.
        """
        limits_for(Vehicle(), (), box=self.box, speed=self.speed, tilt=self.tilt)
        return self


@dc.dataclass(frozen=True)
class NextMotion:
    """A motion to fly.

    limits: that it must keep.   design: processor time of the search and of its flights in the simulator [s].
    simulated: largest share of a limit that it uses there, under any explanation; None: it was not flown there [1].
    entropy: expected after the flight; None: nothing is expected [nat].
    """

    name: str
    reference: Reference
    limits: Limits
    design: float = 0.0
    simulated: float | None = None
    entropy: float | None = None


def next_motion(arm: str, answer: Answer, room: Room, seed: int) -> NextMotion:
    """Return the next motion of an arm after an answer.

    Args:
        arm: of `ARMS`.
        answer: of the flights so far; its explanations set the limits, and `designed` is to separate them.
        room: for the flight.
        seed: of the search and of random motions.
    Raises: ValueError: if no motion keeps the limits under every explanation; one line.
    """
    every = answer.explanations
    vehicle = answer.case.vehicle
    limits = limits_for(vehicle, every, box=room.box, speed=room.speed, tilt=room.tilt)
    readings = answer.diagnosis.readings
    if arm == DESIGNED and every and readings is not None:
        accelerations = bool(readings.noise.active[9:12].any())
        return _designed(FlightDesigner(every, readings, limits, room.seconds, accelerations), room, seed)
    name = BLIND if arm == DESIGNED else arm
    return NextMotion(name, naive_motions(limits, Basis(room.seconds, 1 / RATE), SHARE, seed)[name], limits)


def _designed(designer: FlightDesigner, room: Room, seed: int) -> NextMotion:
    start = time.process_time()
    best = designer.candidates(evaluations=room.evaluations, seed=seed)[0]
    best, flown = keep_limits(best, designer, InChallenge(designer), controller=CONTROLLER)
    spent = time.process_time() - start
    worst = max(f.worst for f in flown)
    entropy = best.information.outlook.entropy
    return NextMotion(DESIGNED, best.reference, designer.limits, spent, worst, entropy)


@dc.dataclass(frozen=True)
class InChallenge:
    """Flights of a candidate in the simulator and with the controller of the challenge, without noise."""

    designer: FlightDesigner

    def __call__(self, candidate: Candidate, explanation: Explanation) -> Flown:
        """Return the flight of a candidate under an explanation."""
        limits, nothing = self.designer.limits, np.full(len(self.designer.explanations), np.nan)
        t = np.arange(round(self.designer.seconds * RATE)) / RATE
        plan = Plan(candidate.name, candidate.reference)
        try:
            true = fly_true(
                limits.vehicle, plan, explanation.effects, t=t, background=explanation.calibration
            )
        except FailedRun as error:
            return Flown(explanation, {}, nothing, lost=str(error))
        u = limits.vehicle.saturate(true.u)
        return Flown(explanation, usage_of(true.x, u, limits), nothing)
