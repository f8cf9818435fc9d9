"""A flight of the real vehicle: as it was, as its sensors read it, and the limits that it used."""

import dataclasses as dc

from diagrams.challenge.generate.case import FILES, Case
from diagrams.challenge.generate.ground_truth import FlightPair, flight_pair
from diagrams.challenge.generate.make import as_measured
from diagrams.challenge.simulators.drake.simulator import fly_true, sensed
from diagrams.challenge.simulators.flight_plan import Plan
from diagrams.gap.flown_design import usage_of
from np_drake.flight_design.limits import Limits
from np_drake.flight_log import FlightLog

FITTED, HELD_OUT = 0, len(FILES) - 1  # numbers of the first flights of a case
FURTHER = len(FILES)  # number of the first flight after them


@dc.dataclass(frozen=True)
class RealFlight:
    """Flight of the vehicle with its withheld effects.

    true: what it did.   log: what its sensors read.   pair: residuals as measured and without noise, for the truth.
    """

    true: FlightLog
    log: FlightLog
    pair: FlightPair

    def usage(self, limits: Limits) -> dict[str, float]:
        """Return the share of each limit that the flight used, by name [1]."""
        u = limits.vehicle.saturate(self.true.u)
        return usage_of(self.true.x, u, limits)


def fly_real(case: Case, plan: Plan, number: int, seconds: float) -> RealFlight:
    """Fly a plan with the real vehicle under its controller.

    Args:
        case: vehicle, sensors and withheld effects.
        plan: of the flight.
        number: of the flight, which draws its noise and gusts; equal for flights that are compared.
        seconds: of the flight [s].
    Raises: FailedRun: if the vehicle is lost.
    """
    name = f"flight_{number}"
    t, effects = case.instants_in(number, seconds), case.effects_in(number)
    true = fly_true(case.vehicle, plan, effects, t=t, background=case.quality.background(case.vehicle))
    every = dc.replace(sensed(case.vehicle, true, effects, t), name=name)
    exact, noisy = as_measured(case, every, number)
    inside = true.rows(int((true.t < t[0]).sum()), int((true.t <= t[-1]).sum()))
    return RealFlight(inside, noisy, flight_pair(case, name, exact, noisy))
