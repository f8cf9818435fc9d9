"""What causes and calibration leave of the held-out gap beyond the noise: its share, its sizes, and
whether it matters.

One calculation gives all of it. The remainder is what held-out flights show above the noise of the
training flights and slow errors of the attitude, and the structure in that noise that no effect
explains. Its share of the gap has a posterior over blocks of time and over whether each structure
is there.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import signal

from np_drake.diagnosis.decision.unexplained import (
    BRIEF,
    HORIZON,
    Indication,
    squared_position_errors,
)
from np_drake.diagnosis.fitting import BLOCK
from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.held_out import HeldOut
from np_drake.diagnosis.numerics import NoiseModel
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FORCE, TORQUE, WRENCH, FlightResiduals, low_pass
from np_drake.diagnosis.result import Cause, Remainder
from np_drake.effects.gusty_wind import GustyWind

FEWEST = 8  # least number of blocks; they are shorter in short flights; own choice
DRAWS = 400  # of the posterior
SEED = 1  # of its draws, and of the noise
NOISES = 4  # draws of the noise of each flight
# A remainder is material that exceeds the stated size, and in any case between these shares of the
# gap: less than the first is nothing beside what is explained, more than the second is no
# explanation [1]. Source: own choice.
NOTHING, TOO_MUCH = 0.02, 0.2
NEVER_LESS = 1e-6  # share that is left: that nothing is, no flight shows [1]
SURE_GAP = 0.025  # quantile of the gap that is above the noise where there is one [1]


def measure_remainder(
    causes: Sequence[Cause],
    noise: NoiseModel,
    held: HeldOut,
    indications: Sequence[Indication],
    options: Options,
) -> Remainder:
    """Return what causes and calibration leave of the gap on held-out flights.

    indications: of structure that no effect explains, whose power the noise model holds.
    """
    flights, named = held.flights, {c.identifier for c in causes}
    before = {e.name: e.against_file for e in flights}
    after = {e.name: e.y - predicted_residual(e, held.kept(e.name, named)) for e in flights}
    # Of gusts the slow force is explained, though no simulator foresees it.
    for e in flights if GustyWind.identifier in named else ():
        after[e.name][:, FORCE] -= low_pass(after[e.name][:, FORCE], e.grid.step, BRIEF)
    rng = np.random.default_rng(SEED)
    power = noise.rms[WRENCH] ** 2
    scale = np.maximum(noise.rms[WRENCH], 1e-12) ** -2.0 * noise.active[WRENCH] / 6
    likely = np.array([i.probability for i in indications])
    there = rng.uniform(size=(DRAWS, len(indications))) < likely
    # What the noise holds is no larger than the noise, however large a part is that others cancel.
    whole = np.reshape([i.power for i in indications], (-1, 6))
    powers = np.minimum(whole, power)
    materiality, weight, drift = options.materiality, flights[0].weight, np.zeros(6)
    drift[:2] = (options.tolerance.attitude * weight) ** 2
    floor = (power + drift) @ scale
    structure = np.minimum(there @ (powers @ scale), power @ scale)
    gap, left = (
        np.maximum(draws - floor, 0.0) + structure
        for draws in _draws(before, after, held.rows, scale, flights[0].grid.step, rng)
    )
    held_share = powers @ scale / np.maximum(whole @ scale, 1e-300)
    hidden = likely @ powers, float((likely * held_share) @ [i.position for i in indications])
    was, now = (_sizes(flights, y, held.rows, noise, drift, hidden) for y in (before, after))
    # Sizes over the stated ones [1].
    large_before, large = (
        max(force / (materiality.remaining_force * weight), position / materiality.position)
        for force, _, position in (was, now)
    )
    found = Remainder(force=now[0], torque=now[1], position=now[2], position_before=was[2])
    if not (np.quantile(gap, SURE_GAP) > 0 and large_before >= 1):
        return found
    shares = np.maximum(left / np.maximum(gap, 1e-12), NEVER_LESS)
    share, ci95, probability = share_and_probability(shares, large)
    return dc.replace(found, share=share, ci95=ci95, probability=probability)


def share_and_probability(
    shares: np.ndarray, size: float
) -> tuple[float, tuple[float, float], float]:
    """Return the median share of a remainder, its 95 % interval, and the probability that it is
    material [1], from draws (n,) of its share and its size over the stated one [1].
    """
    share = float(np.median(shares))
    low, high = np.quantile(shares, [0.025, 0.975])
    least = float(np.clip(max(share, 0.0) / max(size, 1e-9) ** 2, NOTHING, TOO_MUCH))
    return share, (float(low), float(high)), float(np.mean(shares > least))


def _draws(
    before: Mapping[str, np.ndarray],
    after: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    scale: np.ndarray,
    step: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return draws (`DRAWS`,) of the power of the wrench, weighed by `scale` (6,), before and
    after: of blocks.
    """
    size = max(1, min(round(BLOCK / step), sum(int(own.sum()) for own in rows.values()) // FEWEST))
    blocks = []
    for name, own in rows.items():
        power = np.stack([y[name][own, WRENCH] ** 2 @ scale for y in (before, after)], axis=1)
        split = np.array_split(power, max(1, round(len(power) / size)))
        blocks += [(*some.sum(axis=0), len(some)) for some in split]
    drawn = np.array(blocks)[rng.integers(0, len(blocks), (DRAWS, len(blocks)))].sum(axis=1)
    return drawn[:, 0] / drawn[:, 2], drawn[:, 1] / drawn[:, 2]


def _sizes(
    flights: Sequence[FlightResiduals],
    wrench: Mapping[str, np.ndarray],
    rows: Mapping[str, np.ndarray],
    noise: NoiseModel,
    drift: np.ndarray,
    hidden: tuple[np.ndarray, float],
) -> tuple[float, float, float]:
    """Return the RMS force [N] and torque [N·m] above the noise, and the RMS position error that
    both cause [m].

    drift: (6,) power of slow sensor errors [N², (N·m)²].
    hidden: that of structure that the noise model holds, and its squared position error [m²].
    """
    every = np.concatenate([wrench[e.name][rows[e.name], WRENCH] for e in flights])
    power = np.maximum(np.mean(every**2, axis=0) - noise.rms[WRENCH] ** 2 - drift, 0.0) + hidden[0]
    rng, moved = np.random.default_rng(SEED), []
    for e in flights:
        whole = rows[e.name] | e.outliers  # which are interpolated
        drawn = [_noise_of(noise, len(e.t), rng) for _ in range(NOISES)]
        chance = [squared_position_errors(e, one, whole) for one in drawn]
        seen = squared_position_errors(e, e.bridged(wrench[e.name])[:, WRENCH], whole)
        moved += (seen - np.mean(chance, axis=0)).tolist()
    tilted = drift[FORCE].sum() * (HORIZON**2 / 2 / flights[0].vehicle.mass) ** 2
    further = max(float(np.mean(moved)) - tilted, 0.0) if moved else 0.0
    squares = power[FORCE].sum(), power[TORQUE].sum(), further + hidden[1]
    force, torque, position = np.sqrt(squares).tolist()
    return force, torque, position


def _noise_of(noise: NoiseModel, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Return a draw (rows, 6) of the noise of the wrench."""
    active = np.flatnonzero(noise.active[WRENCH])
    mixing = noise.mixing[np.ix_(active, active)]
    memory = 2 * noise.phi.shape[1]
    driven = (
        np.linalg.solve(mixing, rng.normal(size=(len(active), rows + memory)))
        if len(active)
        else np.zeros((0, 0))
    )
    out = np.zeros((rows, 6))
    for k, c in enumerate(active):
        out[:, c] = signal.lfilter([1.0], [1.0, *-noise.phi[c]], driven[k])[memory:]
    return out
