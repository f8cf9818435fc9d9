"""Onset of gusts in every flight, alone or together with the drag that feels them."""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np

from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FlightResiduals
from np_drake.diagnosis.result import Cause
from np_drake.diagnosis.wind.force_bins import drag_trace
from np_drake.diagnosis.wind.gauss_markov import Begins, WindForce, wind_force
from np_drake.diagnosis.wind.wind_onset import ROUNDS, Begin, loss_of_calm, wind_onset
from np_drake.effects.linear_drag import LinearDrag


@dc.dataclass(frozen=True)
class GustOnset:
    """Gusts felt through `drag`, with parameters from training flights, in these and in held-out flights.

    felt: by flight, (m, 15) what drag and wind together leave in it.
    """

    flights: Sequence[FlightResiduals]
    held_out: Sequence[FlightResiduals]
    felt: Mapping[str, np.ndarray]
    drag: Cause
    options: Options

    def begins(self, known: Begins) -> tuple[dict[str, float | None], dict[str, float | None]]:
        """Return by flight when the wind begins [s], given the `known` onsets, and when the drag does.

        A drag that begins with the wind in one flight does so in all. Flights of the fit say whether it does: what an
        held-out one seems to show moves nothing in them.
        """
        priors = self.options.priors
        acts: Begins = self.drag.onset
        blown = {e.name: self._left(e, {}) for e in self._every}
        at_once = 2 * priors.onset_gain * any(self.drag.onset.get(e.name) is not None for e in self.flights)
        for _ in range(ROUNDS):
            wind = wind_force(self.flights, {e.name: self._left(e, acts) for e in self.flights}, known)
            apart = self._sought(blown, blown, known, wind)
            together = self._sought(blown, self.felt, known, wind)
            late = [e for e in self.flights if any(b[e.name].at is not None for b in (apart, together))]
            gain = sum(apart[e.name].loss - together[e.name].loss for e in late or self.held_out)
            both = gain + at_once > 0
            known = {name: begin.at for name, begin in (together if both else apart).items()}
            acts = known if both else self.drag.onset
        return dict(known), dict(acts)

    def _left(self, e: FlightResiduals, acts: Begins) -> np.ndarray:
        """(m, 15) of what is felt without the drag, which acts from then on."""
        assert isinstance(self.drag.effect, LinearDrag)
        return self.felt[e.name] - drag_trace(e, self.drag.effect, acts)

    @property
    def _every(self) -> tuple[FlightResiduals, ...]:
        return (*self.flights, *self.held_out)

    def _sought(
        self,
        blown: Mapping[str, np.ndarray],
        calm: Mapping[str, np.ndarray],
        known: Begins,
        wind: WindForce,
    ) -> dict[str, Begin]:
        """In every flight.   blown, calm: (m, 15) by flight, what is left of it with a wind and before."""
        before = {e.name: loss_of_calm(e, calm[e.name], wind, self.options) for e in self._every}
        priors = self.options.priors
        found = {
            e.name: wind_onset(e, blown[e.name], known.get(e.name), wind, before[e.name], priors.onset_gain)
            for e in self.flights
        }
        late = any(begin.at is not None for begin in found.values())
        for e in self.held_out:  # what acts throughout the others hardly begins late here
            begin = known.get(e.name) if late else None
            gain = priors.onset_gain if late else priors.new_onset_gain
            found[e.name] = wind_onset(e, blown[e.name], begin, wind, before[e.name], gain)
        return found
