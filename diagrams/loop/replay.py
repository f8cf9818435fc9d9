"""Stand-alone 3-D pages: a Meshcat scene of quadrotors, payloads, arrows and trails, its film, and
the page of a flight.
"""

import dataclasses as dc
import html
import logging
from pathlib import Path

import numpy as np
from jinja2 import Environment, StrictUndefined
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatAnimation,
    MeshcatCone,
    MeshcatParams,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.loop.flight import FlightConfig
from diagrams.loop.flight_result import FlightResult
from np_drake import attitude
from np_drake.files.file_access import write_text
from np_drake.rigid_body import P, Q
from np_drake.vehicle import Vehicle
from np_drake.vehicle.scaling import scales

# seen on a light and a dark ground
DARK = Rgba(0.45, 0.47, 0.5)
GREY = Rgba(0.6, 0.6, 0.6)
# Okabe and Ito's, for colour-blind readers
BLUE = Rgba(0, 0.45, 0.7)
RED = Rgba(0.84, 0.37, 0)
GREEN = Rgba(0, 0.62, 0.45)
PINK = Rgba(0.8, 0.47, 0.65)
FROM = np.array([0.3, -0.85, 0.4])  # direction from what is seen to the camera [1]
NEAR = 8.0  # from a vehicle that is followed to the camera, over its arm; own choice [1]
SIDES = 4  # of the tube that is a trail
SHORTEST = 1e-3  # of an arrow, since three.js cannot invert a scale of 0 [m]
FRAME_RATE = 25.0  # of a film [1/s]
FOREVER = 10_000  # times that a page plays
_THRUST = 3.0  # length of the arrow of hover thrust over the arm [1]
TEMPLATE = Path(__file__).with_name("replay.html.j2")
# A browser then refuses every address: what the page needs is in it.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src data: blob:; font-src data:; worker-src blob:"
)


def new_scene() -> Meshcat:
    """Return an empty scene, whose server nobody is told of; the ground is the page's, light or
    dark.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)
    meshcat = Meshcat(MeshcatParams(host="localhost", show_stats_plot=False))
    # These light the objects; as a background they would show the edges of the cube they are on.
    meshcat.SetProperty("/Background/<object>", "top_color", [0.97, 0.98, 1.0])
    meshcat.SetProperty("/Background/<object>", "bottom_color", [0.8, 0.82, 0.85])
    meshcat.SetProperty("/Background/<object>", "use_ar_background", True)
    # Meshcat's spots are near the origin; far from it only this one is seen.
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
    meshcat.SetProperty("/Axes", "visible", False)
    return meshcat


def add_quadrotor(
    meshcat: Meshcat, vehicle: Vehicle, path: str = "quadrotor", overlay: Rgba | None = None
) -> None:
    """Add body, arms and rotors at the vehicle's size, in body axes.

    Args:
        overlay: one colour, with its transparency, of all parts; None: solid, the front pair of
            rotors coloured.
    """
    size = scales(vehicle).length
    meshcat.SetObject(f"{path}/body", Box(0.5 * size, 0.5 * size, 0.2 * size), overlay or DARK)
    for i, p in enumerate(vehicle.rotor_positions):
        arm = np.array(p, float)
        yaw = RotationMatrix.MakeZRotation(np.arctan2(arm[1], arm[0]))
        beam = Box(np.linalg.norm(arm[:2]), 0.07 * size, 0.07 * size)
        meshcat.SetObject(f"{path}/arm{i}", beam, overlay or DARK)
        meshcat.SetTransform(f"{path}/arm{i}", RigidTransform(yaw, arm * [0.5, 0.5, 1.0]))
        disc = Cylinder(vehicle.rotor_radius, 0.04 * size)
        color = BLUE if arm[0] > 0 else GREY  # so that heading is seen
        meshcat.SetObject(f"{path}/rotor{i}", disc, overlay or color)
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
    a = side
    b = (side + 1) % SIDES
    quad = np.concatenate([[a, b, a + SIDES], [b, b + SIDES, a + SIDES]], axis=1).T  # (2 sides, 3)
    faces = (quad[None] + SIDES * np.arange(len(points) - 1)[:, None, None]).reshape(-1, 3)
    meshcat.SetTriangleMesh(path, vertices.T, faces.astype(np.int32).T, color)


def pose(x: np.ndarray) -> RigidTransform:
    """Return X_WB of a state x (13,)."""
    return RigidTransform(
        RotationMatrix(attitude.rotation_matrix(x[Q] / np.linalg.norm(x[Q]))), x[P]
    )


def bar_pose(start: np.ndarray, vector: np.ndarray) -> tuple[RigidTransform, float]:
    """Return pose and length [m] of an object of unit length along z that shows a vector.

    Args:
        start: (3,) of the vector in W [m].
        vector: (3,) in W [m].
    """
    length = float(np.linalg.norm(vector))
    axis = vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    X = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2), start)
    return X, max(length, SHORTEST)


def tether_pose(x: np.ndarray, hook: np.ndarray, p_WP: np.ndarray) -> tuple[RigidTransform, float]:
    """Return pose and length [m] of the tether's bar, whose origin is its middle.

    Args:
        x: (13,) state of the vehicle.
        hook: (3,) where the tether begins, in B [m].
        p_WP: (3,) position of the payload in W [m].
    """
    span = p_WP - pose(x) @ np.asarray(hook, float)
    return bar_pose(p_WP - 0.5 * span, span)


def flight_scene(config: FlightConfig, track: np.ndarray, *, force: str, payload: bool) -> Meshcat:
    """Return the scene of a flight: vehicle, arrows `thrust` and `force`, payload, and the line
    `reference`.

    Args:
        track: (n, 3) points of the reference in W [m].
    """
    meshcat = new_scene()
    size = scales(config.vehicle).length
    add_quadrotor(meshcat, config.vehicle)
    add_arrow(meshcat, "thrust", 0.04 * size, DARK)
    add_arrow(meshcat, force, 0.07 * size, PINK)
    if payload:
        add_payload(meshcat, config.reality.hung.radius, size)
    meshcat.SetLine("reference", track.T, 2.0, BLUE)
    return meshcat


def set_camera(meshcat: Meshcat, track: np.ndarray, size: float) -> float:
    """Set the camera on a whole track, and return its distance [m].

    Args:
        track: (n, 3) in W [m].
        size: of the vehicle [m].
    """
    low = track.min(axis=0)
    high = track.max(axis=0)
    away = 0.75 * float(np.linalg.norm(high - low)) + 4 * size
    target = 0.5 * (low + high) - [0, 0, size]
    meshcat.SetCameraPose(target + away * FROM, target)
    return away


def frames(t: np.ndarray) -> np.ndarray:
    """Return the rows of times t (n,) [s] that are shown, `FRAME_RATE` a second from the first
    on.
    """
    count = int((t[-1] - t[0]) * FRAME_RATE + 1e-6) + 1
    rows = np.searchsorted(t, t[0] + np.arange(count) / FRAME_RATE - 0.5 * np.median(np.diff(t)))
    return np.minimum(rows, len(t) - 1)


class Film(MeshcatAnimation):
    """Animation that is written frame by frame."""

    def __init__(self) -> None:
        super().__init__(FRAME_RATE)
        self.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
        self.set_repetitions(FOREVER)

    def payload(
        self, frame: int, x: np.ndarray, hook: np.ndarray, p_WP: np.ndarray, path: str = ""
    ) -> None:
        """Show a payload on its tether; arguments as of `tether_pose`."""
        self.SetTransform(frame, f"{path}payload", RigidTransform(p_WP))
        self.bar(frame, f"{path}tether", *tether_pose(x, hook, p_WP))

    def bar(self, frame: int, path: str, X_W: RigidTransform, length: float) -> None:
        """Show an object of unit length along its z axis at another length [m]."""
        self.SetTransform(frame, path, X_W)
        self.SetProperty(frame, path, "scale", [1.0, 1.0, length])


@dc.dataclass(frozen=True)
class Page:
    """What stands over the scene.

    start: the clock's time in the first frame [s].
    read_outs: (label, colour, values): position errors that are shown as a number and as a curve,
        (frames,) [m]; infinite where lost.
    trails: (path, first, last): in frame k, points `first[k]` to `last[k]` of the tube are seen.
    legend: (colour, text).
    follow: path of the object with which the camera flies, and where from it the camera is in a
        window that is wider than high [m].
    wide: whether a window that is wider than high shows the scene's own view, from where it is.
    """

    title: str
    start: float
    read_outs: tuple[tuple[str, Rgba, np.ndarray], ...]
    trails: tuple[tuple[str, np.ndarray, np.ndarray], ...] = ()
    legend: tuple[tuple[Rgba, str], ...] = ()
    note: str = ""
    follow: tuple[str, tuple[float, float, float]] | None = None
    wide: bool = False


def write_page(meshcat: Meshcat, film: Film, page: Page, path: str | Path) -> None:
    """Write the scene with its film as one HTML file.
    Raises: OSError: if it cannot be written.
    """
    meshcat.SetAnimation(film)
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters["css"] = _css
    template = environment.from_string(TEMPLATE.read_text("utf-8"))
    over = template.render(page=page, numbers=_numbers(page))
    head, rest = meshcat.StaticHtml().split("<title>Drake MeshCat</title>", 1)
    body, end = rest.rsplit("</body>", 1)
    policy = f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
    screen = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    title = f"{screen}{policy}<title>{html.escape(page.title)}</title>"
    write_text(path, f"{head}{title}{body}{over}</body>{end}")


def _numbers(page: Page) -> dict:
    """Return the numbers of the page: errors in cm, trails in indices of their triangles."""

    def cm(value: float) -> float | None:
        return round(100 * float(value), 2) if np.isfinite(value) else None

    def scene(path: str) -> list[str]:
        return ["drake", *path.split("/")]

    return {
        "start": page.start,
        "rate": FRAME_RATE,
        "follow": page.follow and {"path": scene(page.follow[0]), "eye": list(page.follow[1])},
        "wide": page.wide,
        "errors": [
            {"label": label, "color": _css(color), "cm": [cm(value) for value in values]}
            for label, color, values in page.read_outs
        ],
        "trails": [
            {
                "path": scene(path),
                "first": (6 * SIDES * first).tolist(),
                "last": (6 * SIDES * last).tolist(),
            }
            for path, first, last in page.trails
        ],
    }


def _css(color: Rgba) -> str:
    red, green, blue = (round(255 * c) for c in (color.r(), color.g(), color.b()))
    return f"rgb({red},{green},{blue})"


def write_replay(flight: FlightResult, path: str | Path) -> None:
    """Write an HTML page that plays the flight: vehicle, payload, flown and reference path, thrust,
    force, errors.
    Raises: OSError: if it cannot be written.
    """
    film = Film()
    s = flight.signals
    config = flight.config
    hung = flight.payload_position
    t = s["t"]
    rows = frames(t)
    size = scales(config.vehicle).length
    x = s["x_true"]
    reality = config.reality
    meshcat = flight_scene(
        config, s["p_ref"][flight.scored], force="force", payload=hung is not None
    )
    if len(rows) > 1:
        add_trail(meshcat, "trail", x[rows, :3], 0.06 * size, GREEN)
    points = config.reference.waypoints
    for number, point in enumerate([] if points is None else points):
        meshcat.SetObject(f"waypoints/{number}", Sphere(0.12 * size), GREY)
        meshcat.SetTransform(f"waypoints/{number}", RigidTransform(point))
    thrust, force, factor = _arrows(flight)
    known = "true" if flight.wrench_label is None else "estimated"
    away = set_camera(meshcat, s["p_ref"][rows], size)
    near = min(away, NEAR * size + (0.0 if hung is None else reality.hung.length))
    releases = (event.time for event in config.events if event.kind == "release")
    released = min(releases, default=np.inf)
    for frame, k in enumerate(rows):
        film.SetTransform(frame, "quadrotor", pose(x[k]))
        film.bar(frame, "thrust", *bar_pose(x[k, :3], thrust[k]))
        film.bar(frame, "force", *bar_pose(x[k, :3], force[k]))
        if hung is not None:
            hangs = t[k] >= reality.hangs_at
            cut = t[k] >= released
            film.payload(frame, x[k], np.array(reality.hung.hook), hung[k])
            film.SetProperty(frame, "payload", "visible", bool(hangs))
            film.SetProperty(frame, "tether", "visible", bool(hangs and not cut))
    count = np.arange(len(rows))
    page = Page(
        title=flight.title,
        start=float(t[0]),
        read_outs=(("position error", GREEN, position_error(flight)[rows]),),
        trails=(("trail", 0 * count, count),) if len(rows) > 1 else (),
        legend=(
            (GREEN, "flown path"),
            (BLUE, "reference, and the front rotors"),
            (DARK, "thrust"),
            (PINK, f"{known} external force × {factor:g}"),
            *([] if points is None else [(GREY, "waypoints")]),
        ),
        follow=("quadrotor", tuple(near * FROM)),
        wide=True,
    )
    write_page(meshcat, film, page, path)


def position_error(flight: FlightResult) -> np.ndarray:
    """Return the distance from the reference of each row (n,) [m]."""
    return np.linalg.norm(flight.flown - flight.signals["p_ref"], axis=1)


def _arrows(flight: FlightResult) -> tuple[np.ndarray, np.ndarray, float]:
    """Return thrust and estimated force as arrows (n, 3) in W [m], and by how much longer the force
    is drawn [1].
    """
    s = flight.signals
    vehicle = flight.config.vehicle
    scale = _THRUST * scales(vehicle).length / (vehicle.mass * vehicle.gravity)  # [m/N]
    thrust = s["rotor_thrust"].sum(axis=1, keepdims=True) * attitude.body_z(s["x_true"][:, 3:7])
    chi = next(
        c for c in (flight.chi_foreseen, flight.wrench_label, flight.chi_true) if c is not None
    )
    force = np.nan_to_num(chi[:, :3])
    usual = np.quantile(np.linalg.norm(force[flight.scored], axis=1), 0.9)
    room = 0.9 * vehicle.mass * vehicle.gravity / max(usual, 1e-9)
    factor = max((f for f in (1.0, 2.0, 5.0, 10.0, 20.0, 50.0) if f <= room), default=1.0)
    return scale * thrust, factor * scale * force, factor
