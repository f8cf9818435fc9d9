"""Learns a correction of the cascaded controller by the cross-entropy method, a minute on one core.

Shows: a function that draws simulators, `make_env`, a policy of seven numbers (a quadrotor rolls as it pitches), and a
test on simulators that were not trained on. Needs the extra `gym`.
"""

import dataclasses as dc

import numpy as np

from diagrams.gym import make_env
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig

CIRCLE = load_experiment("circle")
SCALES = np.repeat([0.1, 0.3, 1.5, 0.3], 3)  # of errors, velocity and the reference 0.4 s ahead [m, m/s]


def draw(rng: np.random.Generator) -> FlightConfig:
    """A circle of 6 s with a payload, drag and thrust that nobody knows."""
    real = CIRCLE.reality
    mass, length = rng.uniform(0.7, 1.3, 2) * [real.payload.mass, real.payload.length]
    payload = dc.replace(real.payload, mass=mass, length=length)
    drag, thrust = rng.uniform(0.15, 0.35), rng.uniform(0.92, 1.0)
    reality = dc.replace(real, payload=payload, rotor_drag=drag, thrust_scale=thrust)
    reference = dc.replace(CIRCLE.reference, ramp=2.0)
    return dc.replace(CIRCLE, duration=4.0, reference=reference, reality=reality)


def fly(env, gains: np.ndarray, seed: int) -> float:
    """Time on the reference in one episode [s]."""
    (observation, _), total, ended = env.reset(seed=seed), 0.0, False
    while not ended:
        seen = (np.r_[observation[:9], observation[24:27]] / SCALES).reshape(4, 3)
        x, y, _ = gains[:4] @ seen
        thrust = gains[4:6] @ seen[:2, 2] + gains[6]
        observation, reward, lost, over, _ = env.step(np.clip([thrust, -y, x, 0.0], -1.0, 1.0))
        total, ended = total + reward, lost or over
    return total


def main(rounds: int = 6) -> None:
    """Trains on eight simulators; prints mean and worst time on the reference in eight others."""
    arguments = {"authority": 0.25, "period": 0.04}  # a decision every second update of the sensors
    rng, env = np.random.default_rng(0), make_env(draw, base="cascade", draw_seed=0, **arguments)
    mean, deviation = np.zeros(7), np.full(7, 0.1)
    for _ in range(rounds):
        seed, gains = int(rng.integers(1000)), mean + deviation * rng.standard_normal((16, 7))
        best = gains[np.argsort([-fly(env, candidate, seed) for candidate in gains])[:4]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.01
    for name, learned in {"hover thrust": 0.0, "cascade": 0.0, "cascade + correction": mean}.items():
        held_out = make_env(draw, base=name.split()[0], draw_seed=1, **arguments)
        times = [fly(held_out, np.zeros(7) + learned, seed) for seed in range(100, 116)]
        print(f"{name:20} {np.mean(times):.2f} of 6 s on the reference, worst {np.min(times):.2f} s")


if __name__ == "__main__":
    main()
