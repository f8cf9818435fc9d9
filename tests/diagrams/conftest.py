"""Fixtures: what a replay page holds, read from its file as a browser would."""

import base64
import json
import re
from collections.abc import Callable
from pathlib import Path

import msgpack
import numpy as np
import pytest

from diagrams.batch import run as campaign
from np_drake import attitude
from np_drake.flight_log import FlightLog


@pytest.fixture
def in_this_process(monkeypatch):
    """Cases of campaigns run in this process, where a test can change what they call."""

    def here(work, cases, jobs):
        return ((number, work(case)) for number, case in enumerate(cases))

    monkeypatch.setattr(campaign, "as_they_finish", here)


class ReplayPage:
    """Page of a replay: `film` by object and property, `numbers` of the read-outs, `objects`,
    `properties`.
    """

    def __init__(self, path: Path):
        self.text, self.film = path.read_text(), {}
        embedded = re.findall(r'octet-binary;base64,([A-Za-z0-9+/=]+)"\)\s*\.then', self.text)
        commands = [
            msgpack.unpackb(base64.b64decode(part), ext_hook=lambda _, data: data)
            for part in embedded
        ]
        self.objects = {
            c["path"].removeprefix("/drake/") for c in commands if c["type"] == "set_object"
        }
        self.properties = {
            (c["path"], c["property"]): c["value"] for c in commands if c["type"] == "set_property"
        }
        for animated in (
            a for c in commands if c["type"] == "set_animation" for a in c["animations"]
        ):
            tracks = {
                t["name"][1:]: np.array([k["value"] for k in t["keys"]])
                for t in animated["clip"]["tracks"]
            }
            self.film[animated["path"].removeprefix("/drake/")] = tracks
        found = re.search(
            r'<script id="np-drake-data" type="application/json">(.*?)</script>', self.text, re.S
        )
        self.numbers = json.loads(found[1])


@pytest.fixture(scope="session")
def replay_page() -> Callable[[Path], ReplayPage]:
    """Reader of a page's file."""
    return ReplayPage


def excited(vehicle, seed: int = 0, seconds: float = 12.0, size: float = 1.0) -> FlightLog:
    """A rigid body on a multisine: rotor speed follows from its motion; size 0 hovers."""
    rng, step = np.random.default_rng(seed), 0.001
    t = step * np.arange(round(seconds / step) + 1)
    frequency = (
        2 * np.pi * np.array([0.4, 0.9, 1.6])[:, None, None] * rng.uniform(0.9, 1.1, (3, 1, 3))
    )
    phase = frequency * t[None, :, None] + rng.uniform(0, 2 * np.pi, (3, 1, 3))
    strength = size * np.array([1.6, 1.6, 1.2])  # [m/s²]
    a = np.sum(strength * np.sin(phase), axis=0)
    v, p = (
        np.sum(-strength / frequency * np.cos(phase), axis=0),
        np.sum(-strength / frequency**2 * np.sin(phase), axis=0),
    )
    yaw = 0.5 * size * np.sin(2 * np.pi * 0.5 * t) + 0.2 * size * np.sin(2 * np.pi * 1.3 * t)
    force = a + [0.0, 0.0, 9.81]
    lift = np.linalg.norm(force, axis=1)
    q = attitude.quaternion_from_axes(force / lift[:, None], yaw)
    turned = attitude.rotation_vector(attitude.multiply(attitude.conjugate(q[:-2]), q[2:])) / (
        2 * step
    )
    w = np.concatenate([turned[:1], turned, turned[-1:]])
    al = np.gradient(w, step, axis=0)
    torque = al @ vehicle.J.T + np.cross(w, w @ vehicle.J.T)
    u = np.concatenate([vehicle.mass * lift[:, None], torque], axis=1)
    spin = np.sqrt(np.maximum(u @ vehicle.unmixer.T, 0.0) / vehicle.thrust_coefficient)
    rows = slice(0, None, 10)
    n = len(t[rows])
    noisy = [
        x[rows] + s * rng.normal(size=(n, x.shape[1]))
        for x, s in ((w, 0.005), (a, 0.05), (spin, 1.0))
    ]
    return FlightLog(
        t[rows],
        p[rows] + [0.0, 0.0, 2.0],
        q[rows],
        v[rows],
        noisy[0],
        u[rows],
        a=noisy[1],
        rotor=noisy[2],
        name=f"flight{seed}",
        input="rotor_speed",
    )


@pytest.fixture(scope="session")
def excited_flight():
    """Maker of small flights: `(vehicle, seed, seconds, size) -> FlightLog`."""
    return excited
