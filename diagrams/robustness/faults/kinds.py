"""Kinds of fault with their distributions.

Source of all ranges: own choice, from mild to more than a flight should meet. They are those of a vehicle of 2 kg with
rotors of 12 N. Uniform on [a, b] unless a range says otherwise; directions are uniform.
"""

from typing import Any

import numpy as np

from diagrams.loop.flight import FlightConfig
from diagrams.robustness.faults.fault import Fault, Kind
from np_drake.effects.effect_entry import EffectEntry
from np_drake.faults.measurement import (
    BiasJump,
    DroppedSamples,
    FrozenSamples,
    LateSamples,
    NanBurst,
    PoseJump,
    RepeatedSamples,
)
from np_drake.faults.solver import LateSolves, SolverFault
from systems.payload_event import attach, push, release

Draw = tuple[float | None, dict[str, Any]]
STREAMS = ("motion capture", "imu", "all")  # that a receiver or a driver can lose together
NONE = (0.0, 0.0, 0.0)


def _log_uniform(rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _direction(rng, size: float) -> list[float]:
    vector = rng.normal(size=3)
    return (size * vector / np.linalg.norm(vector)).tolist()


def _stream(rng, duration: float, **values: Any) -> Draw:
    return duration, {"sensor": str(rng.choice(STREAMS)), **values}


def _seed(rng) -> int:
    return int(rng.integers(2**31))


def _bias(rng) -> Draw:
    gyroscope = bool(rng.random() < 0.5)
    rate = _direction(rng, _log_uniform(rng, 0.02, 0.2)) if gyroscope else list(NONE)
    force = list(NONE) if gyroscope else _direction(rng, _log_uniform(rng, 0.2, 2.0))
    return None, {"rate": rate, "acceleration": force}


def _effect(effect: str):
    """Return the maker of an effect of that name whose parameters are the fault's values."""

    def make(fault: Fault, config: FlightConfig) -> EffectEntry:
        return EffectEntry(effect, dict(fault.values), onset=fault.onset)

    return make


def _wind(rng) -> Draw:
    speed, heading = rng.uniform(2.0, 8.0), rng.uniform(0.0, 2 * np.pi)
    return None, {"x": float(speed * np.cos(heading)), "y": float(speed * np.sin(heading)), "z": 0.0}


def _late_solves(fault: Fault, config: FlightConfig) -> LateSolves:
    period = config.controller.period
    return LateSolves(
        **fault.span, median=fault.values["median"] * period, spread=0.5, deadline=period, seed=fault.values["seed"]
    )


KINDS = (
    Kind(
        "NaN burst",
        "sensors",
        lambda rng: _stream(rng, _log_uniform(rng, 0.02, 0.6)),
        lambda f, c: NanBurst(**f.span, **f.values),
        "0.02 to 0.6 s (log-uniform) of motion capture, IMU or both",
    ),
    Kind(
        "dropped samples",
        "sensors",
        lambda rng: _stream(rng, rng.uniform(0.5, 1.5), share=rng.uniform(0.2, 0.8), seed=_seed(rng)),
        lambda f, c: DroppedSamples(**f.span, **f.values),
        "20 to 80 % of the samples lost for 0.5 to 1.5 s; the last received stands",
    ),
    Kind(
        "repeated samples",
        "sensors",
        lambda rng: _stream(rng, rng.uniform(0.5, 1.5), times=int(rng.integers(2, 6))),
        lambda f, c: RepeatedSamples(**f.span, **f.values),
        "each sample 2 to 5 times for 0.5 to 1.5 s",
    ),
    Kind(
        "late samples",
        "sensors",
        lambda rng: _stream(rng, rng.uniform(0.5, 1.5), samples=int(rng.integers(1, 6))),
        lambda f, c: LateSamples(**f.span, **f.values),
        "1 to 5 periods (20 to 100 ms) late for 0.5 to 1.5 s",
    ),
    Kind(
        "frozen sensor",
        "sensors",
        lambda rng: _stream(rng, _log_uniform(rng, 0.04, 0.6)),
        lambda f, c: FrozenSamples(**f.span, **f.values),
        "0.04 to 0.6 s (log-uniform) of motion capture, IMU or both",
    ),
    Kind(
        "bias jump",
        "sensors",
        _bias,
        lambda f, c: BiasJump(f.onset, np.inf, "imu", tuple(f.values["rate"]), tuple(f.values["acceleration"])),
        "gyroscope 0.02 to 0.2 rad/s or accelerometer 0.2 to 2 m/s² (log-uniform); lasts",
    ),
    Kind(
        "position jump",
        "sensors",
        lambda rng: (rng.uniform(0.1, 0.5), {"by": _direction(rng, _log_uniform(rng, 0.05, 0.5))}),
        lambda f, c: PoseJump(**f.span, sensor="motion capture", position=tuple(f.values["by"]), turn=NONE),
        "5 to 50 cm (log-uniform) for 0.1 to 0.5 s",
    ),
    Kind(
        "attitude jump",
        "sensors",
        lambda rng: (rng.uniform(0.1, 0.5), {"by": _direction(rng, _log_uniform(rng, 0.05, 0.35))}),
        lambda f, c: PoseJump(**f.span, sensor="motion capture", position=NONE, turn=tuple(f.values["by"])),
        "3 to 20° (log-uniform) for 0.1 to 0.5 s",
    ),
    Kind(
        "failed solves",
        "solver",
        lambda rng: (_log_uniform(rng, 0.02, 0.8), {}),
        lambda f, c: SolverFault(**f.span),
        "every solve for 0.02 to 0.8 s (log-uniform)",
    ),
    Kind(
        "late solves",
        "solver",
        lambda rng: (rng.uniform(0.5, 1.5), {"median": rng.uniform(0.5, 1.2), "seed": _seed(rng)}),
        _late_solves,
        "simulated time log-normal, median 0.5 to 1.2 periods, spread 0.5, deadline one period, for 0.5 to 1.5 s",
    ),
    Kind(
        "saturated rotors",
        "rotors",
        lambda rng: (None, {"share": rng.uniform(0.5, 0.8)}),
        _effect("thrust_ceiling"),
        "no rotor above 50 to 80 % of its limit (hover with payload: 48 %); lasts",
    ),
    Kind(
        "weak rotor",
        "rotors",
        lambda rng: (None, {"rotor": float(rng.integers(1, 5)), "efficiency": rng.uniform(0.3, 0.9)}),
        _effect("weak_rotor"),
        "one rotor gives 30 to 90 %; lasts",
    ),
    Kind(
        "lost rotor",
        "rotors",
        lambda rng: (None, {"rotor": float(rng.integers(1, 5)), "efficiency": 0.0}),
        _effect("weak_rotor"),
        "one rotor gives nothing; lasts",
    ),
    Kind(
        "payload attached",
        "payload",
        lambda rng: (None, {"mass": rng.uniform(0.05, 0.25)}),
        lambda f, c: attach(f.onset, f.values["mass"]),
        "50 to 250 g more on the 260 g",
    ),
    Kind("cable cut", "payload", lambda rng: (None, {}), lambda f, c: release(f.onset), "the payload falls"),
    Kind(
        "cable snap",
        "payload",
        lambda rng: (None, {"impulse": rng.uniform(0.1, 0.4)}),
        lambda f, c: push(f.onset, [0.0, 0.0, f.values["impulse"]]),
        "payload tossed up with 0.1 to 0.4 N·s; the cable goes slack and snaps taut",
    ),
    Kind("wind step", "air", _wind, _effect("constant_wind"), "2 to 8 m/s, horizontal, at once; lasts"),
    Kind(
        "battery sag",
        "battery",
        lambda rng: (None, {"scale": rng.uniform(0.7, 0.95)}),
        _effect("thrust_scale"),
        "thrust over command falls to 70 to 95 % at once; lasts",
    ),
)
KIND = {kind.name: kind for kind in KINDS}
FIRST = (2.5, 3.5)  # onset of the first fault [s]
APART = (0.0, 1.0)  # onset of the second after the first [s]


def draw_faults(rng: np.random.Generator, places: tuple[str, ...]) -> list[Fault]:
    """Return one fault or, with the same probability, two of different kinds, each kind equally likely.

    Args:
        rng: source of the draw.
        places: of kinds that can reach the controller.
    """
    kinds = [kind for kind in KINDS if kind.place in places]
    count, onset, faults = 1 + int(rng.integers(2)), float(rng.uniform(*FIRST)), []
    for number in rng.permutation(len(kinds))[:count]:
        duration, values = kinds[number].draw(rng)
        faults.append(Fault(kinds[number].name, onset, duration, values))
        onset += float(rng.uniform(*APART))
    return faults
