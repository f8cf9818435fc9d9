"""Flight that is seen and pushed in a browser while it is simulated."""

import signal
from collections import deque
from types import FrameType

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from diagrams.loop.flight import FlightConfig
from diagrams.loop.replay import (
    GREEN,
    SHORTEST,
    arm_length,
    bar_pose,
    flight_scene,
    pose,
    set_camera,
    tether_pose,
)
from np_drake import attitude

REALTIME = 1.0  # [1]
PERIOD = 0.04  # between two pictures [s]
PUSH = 0.4  # time that a push lasts [s]
VEHICLE, PAYLOAD, STOP = "push vehicle (V)", "push payload (P)", "stop (Esc)"
KEYS = {VEHICLE: "KeyV", PAYLOAD: "KeyP", STOP: "Escape"}
SLIDERS = ("push x [weight]", "push y [weight]", "push z [weight]")  # of the body that is pushed
MOST = 0.5  # of a push along an axis, over the weight [1]
_TRAIL = 250  # pictures that the trail lasts


class LiveView:
    """Meshcat server that shows a flight, a `Watch` of `diagrams.loop.flight`.

    Sliders set a force; a button or its key lets it act on vehicle or payload for `PUSH` seconds.
    The button `stop` or SIGINT ends the flight. Use it as a context manager, for SIGINT.
    """

    def __init__(self, config: FlightConfig, *, rate: float | None = None):
        """Start the server.

        Args:
            rate: real-time rate; 0 for as fast as possible; None: `REALTIME` [1].
        """
        self.period, self.rate = PERIOD, REALTIME if rate is None else rate
        self.stopped = False
        self.error = 0.0  # distance from the reference at the last look [m]
        self._config, self._reference = config, config.motion
        self.has_payload = config.reality.hung.tether == "cable"
        self._size, gravity = arm_length(config.vehicle), config.vehicle.gravity
        track = self._reference.sample(np.arange(config.reference.lead, config.end, PERIOD))[0]
        self.meshcat = flight_scene(config, track, force="push", payload=self.has_payload)
        set_camera(self.meshcat, track, self._size)
        self._trail: deque[np.ndarray] = deque(maxlen=_TRAIL)
        masses = {VEHICLE: config.vehicle.mass, PAYLOAD: config.reality.hung.mass}
        self._weight = {name: mass * gravity for name, mass in masses.items()}  # [N]
        pushes = (VEHICLE, PAYLOAD) if self.has_payload else (VEHICLE,)
        self._until = dict.fromkeys(pushes, -np.inf)  # when a push ends [s]
        self._clicks = dict.fromkeys(pushes, 0)
        for name, value in zip(SLIDERS, (0.3, 0.0, 0.0), strict=True):
            self.meshcat.AddSlider(name, -MOST, MOST, MOST / 50, value)
        for name in (*pushes, STOP):
            self.meshcat.AddButton(name, KEYS[name])

    def __enter__(self) -> "LiveView":
        self._before = signal.signal(signal.SIGINT, self._interrupted)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def begin(self, diagram: Diagram, context: Context) -> None:
        """See the flight before it begins.

        Args:
            diagram: of `make_flight_diagram`.
        """
        self._vehicle = diagram.GetSubsystemByName("tethered_quadrotor")
        self._push = self._vehicle.GetSubsystemByName("push")
        self._show(context)

    def look(self, context: Context) -> bool:
        """Show the flight and let the pushes act; return whether it goes on."""
        forces = self.forces(context.get_time())
        self._push.set_force(self._push.GetMyMutableContextFromRoot(context), *forces)
        self._show(context, forces)
        self.stopped = self.stopped or self.meshcat.GetButtonClicks(STOP) > 0
        return not self.stopped

    def forces(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the forces (3,) in W that act on vehicle and payload at time t [s], in N."""
        slid = np.array([self.meshcat.GetSliderValue(name) for name in SLIDERS])
        found = {VEHICLE: np.zeros(3), PAYLOAD: np.zeros(3)}
        for name, before in self._clicks.items():
            self._clicks[name] = self.meshcat.GetButtonClicks(name)
            if self._clicks[name] > before:
                self._until[name] = t + PUSH
            if t < self._until[name]:
                found[name] = self._weight[name] * slid
        return found[VEHICLE], found[PAYLOAD]

    def _interrupted(self, signum: int, frame: FrameType | None) -> None:
        self.stopped = True

    def _show(self, context: Context, forces: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        """Move all objects to where they are, with the pushes that act."""
        inner, t = self._vehicle.GetMyContextFromRoot(context), context.get_time()
        x, thrust, plant = (
            self._vehicle.GetOutputPort(name).Eval(inner)
            for name in ("x", "rotor_thrust", "plant_state")
        )
        scale = 3 * self._size / self._weight[VEHICLE]  # as on the replay page [m/N]
        self.meshcat.SetTransform("quadrotor", pose(x))
        self._show_bar("thrust", *bar_pose(x[:3], scale * thrust.sum() * attitude.body_z(x[3:7])))
        start, push = x[:3], np.zeros(3) if forces is None else forces[0]
        if self.has_payload:
            p_WP, reality = plant[11:14], self._config.reality
            self.meshcat.SetTransform("payload", RigidTransform(p_WP))
            self._show_bar("tether", *tether_pose(x, np.array(reality.hung.hook), p_WP))
            for name in ("payload", "tether"):
                self.meshcat.SetProperty(name, "visible", bool(t >= reality.hangs_at))
            if forces is not None and np.any(forces[1]):
                # drawn as long as a push of that share of weight on the vehicle
                start, push = p_WP, self._weight[VEHICLE] / self._weight[PAYLOAD] * forces[1]
        self._show_bar("push", *bar_pose(start, 4 * scale * push))
        self._trail.append(x[:3].copy())
        if len(self._trail) > 1:
            self.meshcat.SetLine("trail", np.array(self._trail).T, 3.0, GREEN)
        self.error = float(np.linalg.norm(x[:3] - self._reference.sample(np.array([t]))[0, 0]))

    def _show_bar(self, path: str, X_W: RigidTransform, length: float) -> None:
        self.meshcat.SetTransform(path, X_W)
        self.meshcat.SetProperty(path, "scale", [1.0, 1.0, length])
        self.meshcat.SetProperty(path, "visible", length > SHORTEST)
