"""Stand-alone 3-D replay page of a cooperative flight."""

import logging
from pathlib import Path

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.cooperative.result import CooperativeResult
from diagrams.loop.replay.scene import add_quadrotor
from np_drake import attitude
from np_drake.atomic_file import write_text

_FRAME_RATE = 25.0  # [1/s]
_RED, _GREY = Rgba(0.84, 0.37, 0), Rgba(0.6, 0.6, 0.6)


def write_cooperative_replay(flight: CooperativeResult, path: str | Path) -> None:
    """Write an HTML page that plays the scored part: the fleet, its cables and the payload."""
    logging.getLogger("drake").setLevel(logging.WARNING)  # its address is of no use: the page is a file
    config, payload = flight.config, flight.config.reality.payload
    meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    middle = np.array([0.0, 0.0, config.height - 0.4])
    meshcat.SetCameraPose(middle + [1.2, -4.5, 1.8], middle)
    meshcat.SetObject("payload", Sphere(max(payload.radius, 0.05)), _RED)
    for i in range(config.vehicles):
        add_quadrotor(meshcat, config.vehicle, f"quadrotor_{i}")
        meshcat.SetObject(f"cable_{i}", Cylinder(0.006, payload.length), _GREY)
    meshcat.StartRecording(frames_per_second=_FRAME_RATE)
    stride = max(1, round(1 / _FRAME_RATE / config.controller.period))
    for k in np.flatnonzero(flight.rows("all"))[::stride]:
        _pose(meshcat, flight, int(k))
    meshcat.StopRecording()
    meshcat.PublishRecording()
    write_text(path, meshcat.StaticHtml())


def _pose(meshcat: Meshcat, flight: CooperativeResult, k: int) -> None:
    payload, p_WP = flight.config.reality.payload, flight.payload[k]
    t = float(flight.signals["t"][k]) - flight.config.settle
    meshcat.SetTransform("payload", RigidTransform(p_WP), t)
    for i in range(flight.config.vehicles):
        x = flight.signals[f"x_{i}"][k]
        R_WB = attitude.rotation_matrix(x[3:7] / np.linalg.norm(x[3:7]))
        meshcat.SetTransform(f"quadrotor_{i}", RigidTransform(RotationMatrix(R_WB), x[:3]), t)
        span = x[:3] + R_WB @ payload.hook - p_WP
        direction = span / np.linalg.norm(span)
        middle = p_WP + 0.5 * payload.length * direction
        X = RigidTransform(RotationMatrix.MakeFromOneVector(direction, 2), middle)
        meshcat.SetTransform(f"cable_{i}", X, t)
