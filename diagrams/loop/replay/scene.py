"""Objects of a Meshcat scene: quadrotor, payload on its tether, arrows and trails."""

import logging

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, MeshcatCone, MeshcatParams, Rgba, Sphere
from pydrake.math import RigidTransform, RotationMatrix

from np_drake import attitude
from np_drake.rigid_body import P, Q
from np_drake.vehicle import Vehicle

DARK, GREY = Rgba(0.2, 0.2, 0.22), Rgba(0.6, 0.6, 0.6)
BLUE, RED, GREEN, PINK = (  # Okabe and Ito's, for colour-blind readers
    Rgba(0, 0.45, 0.7),
    Rgba(0.84, 0.37, 0),
    Rgba(0, 0.62, 0.45),
    Rgba(0.8, 0.47, 0.65),
)
SIDES = 4  # of the tube that is a trail
SHORTEST = 1e-3  # of an arrow, since three.js cannot invert a scale of 0 [m]


def new_scene() -> Meshcat:
    """Return an empty scene on a light ground, whose server nobody is told of."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    meshcat.SetProperty("/Background/<object>", "top_color", [0.97, 0.98, 1.0])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.8, 0.82, 0.85])
    # Meshcat's spots are near the origin; far from it only this one is seen.
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    meshcat.SetProperty("/Axes", "visible", False)
    return meshcat


def arm_length(vehicle: Vehicle) -> float:
    """Return the mean distance of the rotors from Bo [m]."""
    return float(np.linalg.norm(vehicle.rotor_positions, axis=1).mean())


def add_quadrotor(
    meshcat: Meshcat, vehicle: Vehicle, path: str = "quadrotor", overlay: Rgba | None = None
) -> None:
    """Add body, arms and rotors at the vehicle's size, in body axes.

    Args:
        overlay: one colour, with its transparency, of all parts; None: solid, the front pair of
            rotors coloured.
    """
    size = arm_length(vehicle)
    meshcat.SetObject(f"{path}/body", Box(0.5 * size, 0.5 * size, 0.2 * size), overlay or DARK)
    for i, p in enumerate(vehicle.rotor_positions):
        arm = np.array(p, float)
        yaw = RotationMatrix.MakeZRotation(np.arctan2(arm[1], arm[0]))
        beam = Box(float(np.linalg.norm(arm[:2])), 0.07 * size, 0.07 * size)
        meshcat.SetObject(f"{path}/arm{i}", beam, overlay or DARK)
        meshcat.SetTransform(f"{path}/arm{i}", RigidTransform(yaw, arm * [0.5, 0.5, 1.0]))
        color = BLUE if arm[0] > 0 else GREY  # so that heading is seen
        meshcat.SetObject(
            f"{path}/rotor{i}", Cylinder(vehicle.rotor_radius, 0.04 * size), overlay or color
        )
        meshcat.SetTransform(f"{path}/rotor{i}", RigidTransform(arm + [0, 0, 0.09 * size]))


def add_payload(
    meshcat: Meshcat, radius: float, size: float, path: str = "", overlay: Rgba | None = None
) -> None:
    """Add `{path}payload`, a sphere, and `{path}tether`, a bar of unit length along z.

    Args:
        radius: of the sphere [m].
        size: of the vehicle, for the thickness of the tether [m].
        overlay: colour of both; None: their own.
    """
    meshcat.SetObject(f"{path}payload", Sphere(radius), overlay or RED)
    meshcat.SetObject(f"{path}tether", Cylinder(0.02 * size, 1.0), overlay or DARK)


def add_waypoints(meshcat: Meshcat, points: np.ndarray, size: float) -> None:
    """Add a ball at each waypoint, `waypoints/0` and on.

    Args:
        points: (k, 3) in W [m].
        size: of the vehicle [m].
    """
    for number, point in enumerate(points):
        meshcat.SetObject(f"waypoints/{number}", Sphere(0.12 * size), GREY)
        meshcat.SetTransform(f"waypoints/{number}", RigidTransform(point))


def add_arrow(meshcat: Meshcat, path: str, radius: float, color: Rgba) -> None:
    """Add an arrow of unit length along z; its z scale is its length.

    Args:
        radius: of the shaft [m].
    """
    meshcat.SetObject(f"{path}/shaft", Cylinder(radius, 0.75), color)
    meshcat.SetTransform(f"{path}/shaft", RigidTransform([0, 0, 0.375]))
    meshcat.SetObject(f"{path}/tip", MeshcatCone(0.25, 2.5 * radius, 2.5 * radius), color)
    # A cone stands on its tip.
    X = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, 1.0])
    meshcat.SetTransform(f"{path}/tip", X)


def add_trail(meshcat: Meshcat, path: str, points: np.ndarray, radius: float, color: Rgba) -> None:
    """Add one tube along points, whose faces stand in the order of the points.

    Args:
        points: (n, 3) in W [m].
        radius: of the tube [m].
    """
    direction = np.gradient(points, axis=0)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    steep = np.abs(direction[:, 2:]) > 0.9
    across = np.cross(direction, np.where(steep, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    up = np.cross(across, direction)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * up[:, None]
    vertices = (points[:, None] + radius * ring).reshape(-1, 3)
    side = np.arange(SIDES)
    a, b = side, (side + 1) % SIDES
    quad = np.concatenate([[a, b, a + SIDES], [b, b + SIDES, a + SIDES]], axis=1).T  # (2 sides, 3)
    faces = (quad[None] + SIDES * np.arange(len(points) - 1)[:, None, None]).reshape(-1, 3)
    meshcat.SetTriangleMesh(path, vertices.T, faces.astype(np.int32).T, color)


def pose(x: np.ndarray) -> RigidTransform:
    """Return X_WB of a state x (13,)."""
    return RigidTransform(
        RotationMatrix(attitude.rotation_matrix(x[Q] / np.linalg.norm(x[Q]))), x[P]
    )


def along(start: np.ndarray, vector: np.ndarray) -> RigidTransform:
    """Return the pose whose z axis is along a vector.

    Args:
        start: (3,) origin of the pose in W [m].
        vector: (3,) in W.
    """
    length = np.linalg.norm(vector)
    axis = vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    return RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), start)


def tether_pose(x: np.ndarray, hook: np.ndarray, p_WP: np.ndarray) -> tuple[RigidTransform, float]:
    """Return pose and length [m] of the tether's bar.

    Args:
        x: (13,) state of the vehicle.
        hook: (3,) where the tether begins, in B [m].
        p_WP: (3,) position of the payload in W [m].
    """
    span = p_WP - pose(x) @ np.asarray(hook, float)
    return along(p_WP - 0.5 * span, span), max(float(np.linalg.norm(span)), SHORTEST)
