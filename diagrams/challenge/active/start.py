"""Vehicles with withheld effects as the challenge draws them, and the flights that a loop begins with."""

import dataclasses as dc
from itertools import combinations

import numpy as np

from diagrams.challenge.generate.case import PLANS, Case, CaseDraw, draw_case
from diagrams.challenge.generate.composition import SHARES, compatible
from diagrams.challenge.generate.trajectories import draw_plan
from diagrams.challenge.simulators.flight_plan import Plan
from np_drake.effects.library import LIBRARY

QUALITY = "real"
SECONDS = 20.0  # over which an effect that drifts is drawn [s]
PAIRS = SHARES["pair"] / (
    SHARES["pair"] + 1.0 - sum(SHARES.values())
)  # of the cases, as in the challenge [1]
_NAMES = 40  # stream of the names of the effects


@dc.dataclass(frozen=True)
class Start:
    """What a loop begins with: one flight to fit and a held-out flight of the same kind.

    kinds: of flights that are drawn from; empty: all of the challenge.   fitted, held_out: lengths [s].
    ambiguous: vehicles are drawn until two explanations stand after these flights.
    """

    kinds: tuple[str, ...] = ()
    fitted: float = 20.0
    held_out: float = 10.0
    ambiguous: bool = False

    @property
    def seconds(self) -> float:
        """Time flown [s]."""
        return self.fitted + self.held_out

    def plans(self, case: Case) -> tuple[Plan, Plan]:
        """Return the flight to fit and the held-out flight of a case, of one kind."""
        rng = case.stream(PLANS, 1)
        kind = str(rng.choice(self.kinds)) if self.kinds else None
        first = draw_plan(rng, case.vehicle, self.fitted, kind)
        return first, draw_plan(rng, case.vehicle, self.held_out, first.kind)


STARTS = {
    "ordinary": Start(),
    "short": Start(("hover", "slow_multisine"), 6.0, 6.0, ambiguous=True),
}


def withheld_case(seed: int, attempt: int) -> Case:
    """Return a vehicle with one effect or a compatible pair; equal arguments give equal vehicles."""
    rng = np.random.default_rng([seed, attempt, _NAMES])
    pairs = [pair for pair in combinations(LIBRARY, 2) if compatible(pair)]
    if rng.random() < PAIRS:
        draw = CaseDraw(0, "pair", pairs[rng.integers(len(pairs))], attempt)
    else:
        draw = CaseDraw(0, "single", (str(rng.choice(list(LIBRARY))),), attempt)
    return draw_case(draw, quality=QUALITY, seed=seed, seconds=SECONDS)
