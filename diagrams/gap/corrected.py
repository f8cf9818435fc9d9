"""Corrected simulator of a diagnosis: a scenario with the causes that were found, and draws from their posterior."""

import dataclasses as dc
import math

import numpy as np

from diagrams.gap.remaining import remaining_disturbance
from diagrams.loop.flight import FlightConfig, default_flight
from np_drake.diagnosis.result import Cause, Diagnosis
from np_drake.effects.effect_entry import EffectEntry
from np_drake.effects.posterior import Posterior
from np_drake.vehicle import Vehicle

NAME = "corrected"


def corrected_simulator(diagnosis: Diagnosis, vehicle: Vehicle) -> FlightConfig:
    """Return the scenario of `vehicle` with the causes of a diagnosis and the disturbance that remains.

    Where held-out flights gave a second answer, that one counts: it knows all flights. The reference is the default
    circle of the vehicle, the noise that of its sensors in the simulator.
    """
    answer = diagnosis.refit or diagnosis
    config = default_flight(vehicle)
    reality = dc.replace(
        config.reality.nominal(),
        effects=[entry for cause in answer.causes if (entry := _entry(cause)) is not None],
        disturbance=remaining_disturbance(answer.localisation),
        posterior=answer.posterior or Posterior(),
    )
    return dc.replace(config, name=NAME, reality=reality).check_and_step()


def _entry(cause: Cause) -> EffectEntry | None:
    """Return the entry of a cause; None for one that is absent from all flights."""
    if cause.effect is None:
        return None
    onsets = {flight: 0.0 if t is None else float(t) for flight, t in cause.onset.items()}
    seen = [t for t in onsets.values() if math.isfinite(t)]
    if onsets and not seen:
        return None
    entry = EffectEntry.of(cause.effect, onset=_onset(seen), probability=cause.probability)
    return dc.replace(entry, onsets=onsets)


def _onset(seen: list[float]) -> float | None:
    """Return when an effect begins in a flight to come: in mid-flight only if it did in every flight that shows it."""
    return float(np.median(seen)) if seen and min(seen) > 0 else None


def drawn(config: FlightConfig, count: int, seed: int) -> list[FlightConfig]:
    """Return simulators drawn from the posterior of a corrected one, each with a disturbance of its own.

    Raises: ValueError: if the scenario has no posterior and no uncertain effect, so that all draws were the same.
    """
    reality = config.reality
    if not reality.posterior.parameters and all(e.probability == 1.0 for e in reality.effects):
        raise ValueError(
            f"{config.name}: there must be a posterior to draw from; name reality.posterior, or take the "
            "corrected.yaml of a diagnosis."
        )
    generator, found = np.random.default_rng(seed), []
    for k in range(count):
        effects = reality.posterior.draw(reality.effects, generator)
        disturbance = dc.replace(reality.disturbance, seed=int(generator.integers(2**31)))
        own = dc.replace(reality, effects=effects, disturbance=disturbance)
        found.append(dc.replace(config, name=f"{config.name}_{k + 1}", reality=own).check_and_step())
    return found
