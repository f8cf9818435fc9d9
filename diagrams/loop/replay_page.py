"""Stand-alone 3-D replay page of a flight (Meshcat recording)."""

import logging
from pathlib import Path

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.loop.flight_result import FlightResult
from np_drake import attitude
from np_drake.atomic_file import write_text
from np_drake.vehicle import Vehicle

_FRAME_RATE = 25.0  # [1/s]
_DARK, _RED, _BLUE, _GREY = Rgba(0.2, 0.2, 0.22), Rgba(0.84, 0.37, 0), Rgba(0, 0.45, 0.7), Rgba(0.6, 0.6, 0.6)


def write_replay(flight: FlightResult, path: str | Path) -> None:
    """Write an HTML page that plays the flight: quadrotor, tether, payload, and the reference as a line."""
    logging.getLogger("drake").setLevel(logging.WARNING)  # its address is of no use: the page is a file
    meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    add_quadrotor(meshcat, flight.config.vehicle)
    s = flight.signals
    middle = s["p_ref"].mean(axis=0) - [0.0, 0.0, 0.4]
    meshcat.SetCameraPose(middle + [1.2, -3.2, 1.4], middle)
    meshcat.SetLine("reference", s["p_ref"][flight.scored].T, 2.0, _BLUE)
    if flight.payload_position is not None:
        radius = max(flight.config.reality.hung.radius, 0.04)
        meshcat.SetObject("payload", Sphere(radius), _RED)
        # Animations cannot scale: the bar hangs from the payload side and shows slack as an overlap at the hook.
        meshcat.SetObject("tether", Cylinder(0.006, flight.config.reality.hung.length), _GREY)
    meshcat.StartRecording(frames_per_second=_FRAME_RATE)
    stride = max(1, round(1 / _FRAME_RATE / flight.config.controller.period))
    for k in range(0, len(s["t"]), stride):
        _pose(meshcat, flight, k)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    write_text(path, meshcat.StaticHtml())


def add_quadrotor(meshcat: Meshcat, vehicle: Vehicle, path: str = "quadrotor") -> None:
    """Add body, arms and rotors under `path`, in body axes."""
    meshcat.SetObject(f"{path}/body", Box(0.1, 0.1, 0.05), _DARK)
    for i, p in enumerate(vehicle.rotor_positions):
        arm = np.array(p)
        yaw = RotationMatrix.MakeZRotation(np.arctan2(arm[1], arm[0]))
        meshcat.SetObject(f"{path}/arm{i}", Box(float(np.linalg.norm(arm)), 0.015, 0.015), _DARK)
        meshcat.SetTransform(f"{path}/arm{i}", RigidTransform(yaw, arm / 2))
        # The front pair is coloured, so that heading is seen.
        color = _BLUE if arm[0] > 0 else _GREY
        meshcat.SetObject(f"{path}/rotor{i}", Cylinder(vehicle.rotor_radius, 0.01), color)
        meshcat.SetTransform(f"{path}/rotor{i}", RigidTransform(arm + [0, 0, 0.02]))


def _pose(meshcat: Meshcat, flight: FlightResult, k: int) -> None:
    x, t = flight.signals["x_true"][k], float(flight.signals["t"][k])
    R_WB = attitude.rotation_matrix(x[3:7] / np.linalg.norm(x[3:7]))
    meshcat.SetTransform("quadrotor", RigidTransform(RotationMatrix(R_WB), x[:3]), t)
    if flight.payload_position is None:
        return
    p_WP = flight.payload_position[k]
    p_WT = x[:3] + R_WB @ flight.config.reality.hung.hook
    span = p_WT - p_WP
    direction = span / np.linalg.norm(span)
    R = RotationMatrix.MakeFromOneVector(direction, 2)
    middle = p_WP + 0.5 * flight.config.reality.hung.length * direction
    meshcat.SetTransform("payload", RigidTransform(p_WP), t)
    meshcat.SetTransform("tether", RigidTransform(R, middle), t)
