"""Flight that is seen and pushed in a browser while it is simulated."""

import signal
from collections import deque
from types import FrameType

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from diagrams.loop.flight import FlightConfig
from diagrams.loop.replay.scene import (
    BLUE,
    DARK,
    GREEN,
    PINK,
    SHORTEST,
    add_arrow,
    add_payload,
    add_quadrotor,
    along,
    arm_length,
    new_scene,
    pose,
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
_DEAD = 0.1  # of a gamepad's stick [1]


class LiveView:
    """Meshcat server that shows a flight, a `Watch` of `diagrams.loop.flight`.

    Sliders set a force; a button or its key lets it act on vehicle or payload for `PUSH` seconds.
    The left stick of a gamepad pushes the vehicle along x and y for as long as it is held, with its
    first button the payload. The button `stop` or SIGINT ends the flight. Use it as a context
    manager, for SIGINT.
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
        self.meshcat = new_scene()
        self._trail: deque[np.ndarray] = deque(maxlen=_TRAIL)
        pushes = (VEHICLE, PAYLOAD) if self.has_payload else (VEHICLE,)
        self._until = dict.fromkeys(pushes, -np.inf)  # when a push ends [s]
        self._clicks = dict.fromkeys(pushes, 0)
        gravity = config.vehicle.gravity
        self._weight = {
            VEHICLE: config.vehicle.mass * gravity,
            PAYLOAD: config.reality.hung.mass * gravity,
        }  # [N]
        self._add_objects()
        self._add_controls()

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
        for name in self._until:
            if self._clicked(name):
                self._until[name] = t + PUSH
            if t < self._until[name]:
                found[name] += self._weight[name] * slid
        stick, on_payload = self._stick()
        name = PAYLOAD if on_payload else VEHICLE
        found[name] += self._weight[name] * stick
        return found[VEHICLE], found[PAYLOAD]

    def _clicked(self, name: str) -> bool:
        """Return whether a button was clicked since the last look."""
        clicks = self.meshcat.GetButtonClicks(name)
        more, self._clicks[name] = clicks > self._clicks[name], clicks
        return more

    def _stick(self) -> tuple[np.ndarray, bool]:
        """Return a gamepad's left stick as a push (3,) in W over the weight [1], and whether it is
        the payload's.
        """
        pad = self.meshcat.GetGamepad()
        if pad.index is None or len(pad.axes) < 2:
            return np.zeros(3), False
        axes = [0.0 if abs(a) < _DEAD else a for a in pad.axes[:2]]
        on_payload = self.has_payload and len(pad.button_values) > 0 and pad.button_values[0] > 0.5
        return MOST * np.array([axes[0], -axes[1], 0.0]), on_payload  # the stick's y points down

    def _interrupted(self, signum: int, frame: FrameType | None) -> None:
        self.stopped = True

    def _add_objects(self) -> None:
        config, size = self._config, arm_length(self._config.vehicle)
        add_quadrotor(self.meshcat, config.vehicle)
        add_arrow(self.meshcat, "thrust", 0.04 * size, DARK)
        add_arrow(self.meshcat, "push", 0.07 * size, PINK)
        if self.has_payload:
            add_payload(self.meshcat, config.reality.hung.radius, size)
        t = np.arange(config.reference.lead, config.end, PERIOD)
        track = self._reference.sample(t)[0]
        self.meshcat.SetLine("reference", track.T, 2.0, BLUE)
        low, high = track.min(axis=0), track.max(axis=0)
        away = 0.75 * float(np.linalg.norm(high - low)) + 4 * size
        target = 0.5 * (low + high) - [0, 0, size]
        self.meshcat.SetCameraPose(target + away * np.array([0.3, -0.85, 0.4]), target)

    def _add_controls(self) -> None:
        for name, value in zip(SLIDERS, (0.3, 0.0, 0.0), strict=True):
            self.meshcat.AddSlider(name, -MOST, MOST, MOST / 50, value)
        for name in (*self._until, STOP):
            self.meshcat.AddButton(name, KEYS[name])

    def _show(self, context: Context, forces: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        """Move all objects to where they are, with the pushes that act."""
        inner = self._vehicle.GetMyContextFromRoot(context)
        x, thrust, plant = (
            self._vehicle.GetOutputPort(name).Eval(inner)
            for name in ("x", "rotor_thrust", "plant_state")
        )
        scale = (
            3 * arm_length(self._config.vehicle) / self._weight[VEHICLE]
        )  # as on the replay page [m/N]
        self.meshcat.SetTransform("quadrotor", pose(x))
        self._show_arrow("thrust", x[:3], scale * thrust.sum() * attitude.body_z(x[3:7]))
        start, push = x[:3], np.zeros(3) if forces is None else forces[0]
        if (
            self.has_payload
        ):  # a push on the payload is drawn as long as one of that share of weight on the vehicle
            hung = self._config.reality.hung
            X, length = tether_pose(x, np.array(hung.hook), plant[11:14])
            self.meshcat.SetTransform("payload", RigidTransform(plant[11:14]))
            self.meshcat.SetTransform("tether", X)
            self.meshcat.SetProperty("tether", "scale", [1.0, 1.0, length])
            for name in ("payload", "tether"):
                hangs = context.get_time() >= self._config.reality.hangs_at
                self.meshcat.SetProperty(name, "visible", bool(hangs))
            if forces is not None and np.any(forces[1]):
                share = self._weight[VEHICLE] / self._weight[PAYLOAD]
                start, push = plant[11:14], share * forces[1]
        self._show_arrow("push", start, 4 * scale * push)
        self._trail.append(x[:3].copy())
        if len(self._trail) > 1:
            self.meshcat.SetLine("trail", np.array(self._trail).T, 3.0, GREEN)
        p_ref = self._reference.sample(np.array([context.get_time()]))[0, 0]
        self.error = float(np.linalg.norm(x[:3] - p_ref))

    def _show_arrow(self, path: str, start: np.ndarray, vector: np.ndarray) -> None:
        self.meshcat.SetTransform(path, along(start, vector))
        length = max(float(np.linalg.norm(vector)), SHORTEST)
        self.meshcat.SetProperty(path, "scale", [1.0, 1.0, length])
        self.meshcat.SetProperty(path, "visible", length > SHORTEST)
