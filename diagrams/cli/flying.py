"""Flights behind a progress bar: one after the other, or one in a browser in real time."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from diagrams.batch.failed_run import FailedRun
from diagrams.cli.output import Table, progress, say

if TYPE_CHECKING:
    from diagrams.loop.flight import FlightConfig
    from diagrams.loop.flight_result import FlightResult


def fly_all(
    configs: "list[FlightConfig]", seed: int, lost: list[FailedRun] | None
) -> "list[FlightResult]":
    """Simulate scenarios that begin and end alike, one after the other, behind one progress bar.

    Args:
        lost: takes what ended a flight early; None: nothing may.
    Raises: FailedRun: where nothing may end one early, or no flight is left; it names all.
    """
    from diagrams.loop.flight_result import fly as simulate

    flights, first = [], configs[0]
    names = ", ".join(dict.fromkeys(config.controller.name for config in configs))
    with progress(f"flying {first.name} with {names}", len(configs) * first.end) as advance:
        for k, own in enumerate(configs):

            def tell(t: float, before: float = k * first.end) -> None:
                advance(before + t)

            try:
                flights.append(simulate(own, seed=seed, monitor=tell))
            except FailedRun as failed:
                if lost is None:
                    raise
                lost.append(failed)
    if not flights and lost:
        raise all_lost(lost)
    return flights


def all_lost(lost: Sequence[FailedRun]) -> FailedRun:
    """Return one failure in the words of several."""
    return FailedRun(" ".join(str(one) for one in lost))


def fly_linked(config: "FlightConfig", seed: int, address: str) -> "tuple[FlightResult, Table]":
    """Simulate in real time a vehicle that a process outside commands by MAVLink, until its end.
    Raises: ValueError: where the link cannot be opened.
    """
    from diagrams.autopilot.node import LinkedFlight
    from diagrams.loop.flight_result import fly as simulate
    from np_drake.autopilot.mavlink import MavlinkLink

    link = MavlinkLink(address)
    linked = LinkedFlight(link)
    try:
        say(f"{config.name} behind {address}: np-drake node flies it.")
        with progress(f"flying {config.name}", config.end) as advance:

            def shown(t: float) -> None:
                advance(t, f"at {linked.factor(t):.2f} of real time")

            flight = simulate(config, seed=seed, monitor=shown, watch=linked, controller=linked)
    finally:
        link.close()
    return flight, linked.table()


def fly_live(config: "FlightConfig", seed: int) -> "FlightResult":
    """Simulate in real time before a browser's eyes, until the end, `stop`, Ctrl-C or the loss of
    the vehicle.
    Raises: LostVehicle: where it was lost before anything was recorded.
    """
    from diagrams.loop.flight_result import FlightResult, LostVehicle
    from diagrams.loop.flight_result import fly as simulate
    from diagrams.loop.live import LiveView

    with LiveView(config) as view:
        payload = ", P the payload" if view.has_payload else ""
        say(f"watch it at {view.meshcat.web_url()}: V pushes{payload}; Esc or Ctrl-C ends it.")
        try:
            with progress(
                f"flying {config.name} with {config.controller.name}", config.end
            ) as advance:
                flight = simulate(
                    config,
                    seed=seed,
                    monitor=lambda t: advance(t, f"{100 * view.error:.1f} cm off"),
                    watch=view,
                )
        except LostVehicle as lost:
            if not len(lost.signals["t"]):
                raise
            say(str(lost))
            return FlightResult(config, seed, lost.signals)
    if view.stopped:
        say(f"stopped at {flight.signals['t'][-1]:.1f} s.")
    return flight
