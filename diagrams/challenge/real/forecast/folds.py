"""Flights of the campaign by manoeuvre, and the payload that their logs hold: truth of the oracle
pendulum alone.
"""

import dataclasses as dc
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from diagrams.challenge.real.campaigns import campaign_of
from diagrams.challenge.real.flight_names import block_name, numbered_blocks
from diagrams.challenge.real.flights import open_flights
from diagrams.challenge.real.logged_payload import logged_payload
from np_drake.effects.pendulum import Payload
from np_drake.flight_log import FlightLog
from np_drake.labels import LabelConfig
from np_drake.payload_filter.filter_bank import Estimate, PayloadEstimate
from np_drake.skill.oracle_pendulum import OraclePendulum, Rest, oracle_pendulum, remaining_drag
from np_drake.training_data.training_segments import SampledFlight, sampled_flight
from np_drake.vehicle import Vehicle

PAYLOAD = campaign_of("payload")
# of the payload's logged path, driven by the vehicle's motion; middle of 0.09 to 0.17 [1/s]
DAMPING = 0.13
DAMPINGS = (0.09, 0.17)  # [1/s]


@dc.dataclass(frozen=True)
class PayloadFlight:
    """Opened flight, the manoeuvre it belongs to, and the payload's measured path.

    t: (m,) times of the path on the clock of the log [s].   p: (m, 3) p_WPo [m].
    """

    log: FlightLog
    vehicle: Vehicle
    manoeuvre: str
    t: np.ndarray
    p: np.ndarray

    @property
    def opened(self) -> tuple[FlightLog, Vehicle]:
        """Log and vehicle."""
        return self.log, self.vehicle

    def sampled(self, step: float, label: LabelConfig | None = None) -> SampledFlight:
        """Return the flight at a step.

        Args:
            step: between samples [s].
            label: low-pass of the labels; None: their mean over a step.
        """
        return sampled_flight(self.log, self.vehicle, step=step, label=label)


def true_payload() -> Payload:
    """Return the payload of the campaign, hung from the origin of the vehicle."""
    known = PAYLOAD.truth.parameters
    return Payload(known["mass"].value, known["length"].value, (0.0, 0.0, 0.0), DAMPING)


def true_estimate() -> PayloadEstimate:
    """Return the payload of the campaign as an estimate without a doubt."""
    payload = true_payload()
    values = (payload.length, payload.mass / PAYLOAD.nominal.mass, payload.damping)
    return PayloadEstimate(*(Estimate(value, value, value) for value in values))


def open_campaign(folder: Path) -> list[PayloadFlight]:
    """Return the flights with a payload in a folder as `reproduce real` takes, manoeuvre by
    manoeuvre.

    Raises: ValueError: if there are not two manoeuvres; LogError: if a log cannot be used.
    """
    if not folder.is_dir():
        raise ValueError(f"{folder}: must be a folder of real flights; it is not there.")
    blocks = numbered_blocks(PAYLOAD.files(folder))
    if len(blocks) < 2:
        raise ValueError(
            f"{folder / PAYLOAD.patterns[0]}: must be flights of two manoeuvres (runs of "
            f"numbers); got {len(blocks)}."
        )
    vehicle, found = PAYLOAD.nominal, []
    for block in blocks:
        for path in block:
            for log in open_flights(path, PAYLOAD):
                found.append(
                    PayloadFlight(log, vehicle, block_name(block), *logged_payload(path, log))
                )
    return found


def told(flight: PayloadFlight, step: float, rest: Rest | None = None) -> OraclePendulum:
    """Return the oracle pendulum of a flight, which is told the payload and its path.

    Args:
        step: between samples [s].
        rest: what acts beside the tether; None: nothing.
    """
    path = (flight.t - flight.log.t[0], flight.p)
    return oracle_pendulum(flight.sampled(step), flight.vehicle, true_payload(), path, rest)


def drag_beside(flights: Sequence[PayloadFlight], step: float) -> Rest:
    """Return the drag that oracle pendulums leave, which acts beside the tether.

    Args:
        step: between samples [s].
    """
    return Rest(remaining_drag((flight.sampled(step), told(flight, step)) for flight in flights))
