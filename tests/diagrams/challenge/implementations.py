"""Motions by chance, and both implementations of an out-of-library effect against each other on them."""

import dataclasses as dc

import numpy as np

from diagrams.challenge.out_of_library.draw import draw_out_of_library
from diagrams.challenge.simulators.rotorpy.library_effects import Instant
from np_drake import attitude
from np_drake.effects.base import Motion


def motions(vehicle, n, rng):
    """Motion and instants of the same moments."""
    x = rng.normal(size=(n, 13))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    hover = vehicle.mass * vehicle.gravity / 4
    motion = Motion(
        rng.uniform(0.0, 20.0, n), x, hover * rng.uniform(0.0, 2.0, (n, 4)), rng.normal(size=(n, 3))
    )
    air = attitude.rotate_back(x[:, 3:7], x[:, 7:10] - motion.wind)
    still = np.zeros(4)
    return motion, [
        Instant(t, x[:3], R, x[7:10], v, x[10:], thrust, still, still)
        for t, x, R, v, thrust in zip(motion.t, x, motion.R_WB, air, motion.rotor_thrust, strict=True)
    ]


def moving(v, w=(0.0, 0.0, 0.0), p=(0.0, 0.0, 0.0)):
    """(13,) a level state."""
    return np.concatenate([p, [1.0, 0.0, 0.0, 0.0], v, w])


def same_wrench(name, law, nominal):
    """A law without memory, on many motions at once and on one."""
    rng = np.random.default_rng(7)
    motion, instants = motions(nominal, 50, rng)
    effect = draw_out_of_library(name, rng, nominal)
    chi = effect.wrench(nominal, motion)
    force_B = attitude.rotate_back(motion.x[:, 3:7], chi[:, :3])
    anew = np.array([law(nominal, dc.asdict(effect), now) for now in instants])
    np.testing.assert_allclose(anew, np.concatenate([force_B, chi[:, 3:]], axis=1), atol=1e-10)
    assert np.abs(anew).max() > 1e-3
    one = effect.wrench(nominal, Motion(motion.t[3], motion.x[3], motion.rotor_thrust[3], motion.wind[3]))
    np.testing.assert_allclose(one, chi[3], atol=1e-12)


def same_following(name, hidden, nominal):
    """Of half a second of commands by chance, in small steps of Euler."""
    rng = np.random.default_rng(8)
    effect, hover = draw_out_of_library(name, rng, nominal), nominal.mass * nominal.gravity / 4
    anew = hidden(nominal, dc.asdict(effect))
    commands, step = np.repeat(hover * rng.uniform(0.2, 2.0, (50, 4)), 10, axis=0), 1e-3
    s, own = effect.state_at(nominal, commands[0]), anew.rest(nominal.mixer @ commands[0])
    largest = 0.0
    for command in commands:
        added, rate = anew.act(nominal.mixer @ command, own)
        extra = effect.thrust(nominal, s, command) - command
        np.testing.assert_allclose(added, nominal.mixer @ extra, atol=1e-10)
        s, own = s + step * effect.state_rate(nominal, s, command), own + step * rate
        largest = max(largest, np.abs(added).max())
    assert largest > 1e-2
