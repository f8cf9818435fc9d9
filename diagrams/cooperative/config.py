"""Scenario of the cooperative transport: fleet, payload, timing, and the conditions on a possible flight.

Its file is `cooperative.yaml` beside this one.
"""

import dataclasses as dc
from pathlib import Path

import numpy as np
from pydrake.systems.analysis import SimulatorConfig

from diagrams.loop.controllers import ControllerConfig
from diagrams.loop.flight import ARENA, MOST_ROWS, hook_mobility
from diagrams.loop.reality import RealityConfig
from np_drake.files.yaml_file import load_checked
from np_drake.references.formation import payload_drop, polygon
from np_drake.residual_models.failing import FAULTS
from np_drake.vehicle import Vehicle
from systems.tethered_quadrotor import PayloadConfig

SCENARIO = Path(__file__).with_name("cooperative.yaml")
MOST_VEHICLES = 8  # limit of the scenario; own choice [1]


@dc.dataclass
class CooperativeConfig:
    """Phases of a cooperative transport: settle, hover, move along x, hover.

    Everything after the settling is scored.
    """

    name: str = "cooperative"
    vehicles: int = 3  # number of quadrotors [1]
    spacing: float = 0.9  # between neighbours of the formation [m]
    height: float = 2.0  # of the vehicles [m]
    distance: float = 2.0  # of the transport [m]
    settle: float = 3.0  # not scored [s]
    hover: float = 2.0  # before the transport [s]
    transport: float = 9.0  # top speed 35/16 of its mean [s]
    rest: float = 1.0  # after the transport, scored with it [s]
    fault: str = "none"  # none | zero | frozen: of predictor 0, from the first scored instant on
    vehicle: Vehicle = dc.field(default_factory=Vehicle)
    reality: RealityConfig = dc.field(
        default_factory=lambda: RealityConfig(payload=PayloadConfig(mass=0.5, length=1.2))
    )
    controller: ControllerConfig = dc.field(
        default_factory=lambda: ControllerConfig(kind="payload_filter", solver="sqp")
    )
    simulator: SimulatorConfig = dc.field(
        default_factory=lambda: SimulatorConfig(
            integration_scheme="runge_kutta3", max_step_size=0.004, use_error_control=False
        )
    )

    def check(self) -> "CooperativeConfig":
        """Return self after checking all values.

        Raises: ValueError: where one is impossible.
        """
        for part in (self.vehicle, self.reality, self.controller):
            part.check()
        if not 1 <= self.vehicles <= MOST_VEHICLES:
            raise ValueError(f"cooperative: vehicles must be 1 to {MOST_VEHICLES}; got {self.vehicles}.")
        for name in ("height", "settle", "hover", "transport", "rest"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"cooperative: {name} must be positive; got {getattr(self, name)}.")
        if self.end > MOST_ROWS * self.controller.period:
            raise ValueError(
                f"cooperative: settle, hover, transport and rest must take {MOST_ROWS * self.controller.period:g} s at "
                f"most; got {self.end:g}."
            )
        if not 0 <= self.distance < ARENA:
            raise ValueError(f"cooperative: distance must be 0 to {ARENA:g} m; got {self.distance}.")
        if self.controller.kind not in ("nominal", "hold", "observer", "np", "payload_filter"):
            raise ValueError(
                f"cooperative: each vehicle knows itself alone; no controller {self.controller.kind}."
            )
        if self.fault not in ("none", *FAULTS) or (
            self.fault != "none" and self.controller.kind not in ("np", "payload_filter")
        ):
            raise ValueError(
                f"cooperative: fault must be none, {' or '.join(FAULTS)}, of a predictor; got {self.fault!r}."
            )
        if not self.spacing > self.safe_distance:
            raise ValueError(
                f"cooperative: spacing must exceed {self.safe_distance:.2f} m, where rotors touch; got {self.spacing}."
            )
        self._check_physics()
        return self

    def _check_physics(self) -> None:
        share = self.vehicle.mass + self.reality.payload.mass / self.vehicles
        lift = 4 * self.vehicle.max_rotor_thrust * self.reality.thrust_at(self.vehicle, self.end)
        if share * self.vehicle.gravity > 0.9 * lift:
            raise ValueError(
                f"cooperative: {share} kg a vehicle are more than the rotors can carry ({lift:.0f} N)."
            )
        if self.reality.effects or self.reality.disturbance.acts:
            raise ValueError(
                "CooperativeConfig: reality must name neither effects nor a disturbance, which are for one vehicle."
            )
        if self.reality.payload.tether != "cable":
            raise ValueError("cooperative: the payload must hang on cables.")
        payload_drop(self.radius, self.reality.payload.length, 0.0)
        step = self.simulator.max_step_size
        if not self.simulator.use_error_control and step > self.largest_step:
            raise ValueError(
                f"cooperative: simulator.max_step_size must be at most {self.largest_step:.2g} s for these cables; "
                f"got {step}."
            )

    @property
    def corners(self) -> np.ndarray:
        """Corners of the formation about its centre, (n, 3) [m]."""
        return polygon(self.vehicles, self.spacing)

    @property
    def radius(self) -> float:
        """Radius of the formation [m]."""
        return float(np.linalg.norm(self.corners[0]))

    @property
    def drop(self) -> float:
        """Height of the payload over the vehicles [m]; negative."""
        payload = self.reality.payload
        return payload_drop(self.radius, payload.length, payload.hook[2])

    @property
    def safe_distance(self) -> float:
        """Distance between two vehicles below which rotors may touch [m]."""
        arm = np.linalg.norm(np.array(self.vehicle.rotor_positions)[:, :2], axis=1).max()
        return 2 * float(arm + self.vehicle.rotor_radius)

    @property
    def largest_step(self) -> float:
        """Stability limit of a fixed-step runge_kutta3: 1.7 over the fastest rate of cables and motors [s].

        Cables along unit vectors d_i: the payload feels k sum(d_i d_i^T) / m, each hook k times its mobility.
        """
        payload = self.reality.payload
        d = (self.corners - [0.0, 0.0, self.drop]) / np.hypot(self.radius, self.drop)
        mobility = (
            hook_mobility(self.vehicle, payload.hook) + float(np.linalg.eigvalsh(d.T @ d)[-1]) / payload.mass
        )
        rates = [np.sqrt(payload.stiffness * mobility), payload.damping * mobility]
        rates += [1 / lag for lag in (self.reality.motor_lag, self.vehicle.rotor_time_constant) if lag > 0]
        return float(1.7 / max(rates))

    @property
    def start(self) -> float:
        """Start of the transport [s]."""
        return self.settle + self.hover

    @property
    def end(self) -> float:
        """End of the flight [s]."""
        return self.start + self.transport + self.rest


def load_cooperative(filename: str | Path = SCENARIO) -> CooperativeConfig:
    """Read a scenario file (YAML).

    Raises: ValueError: one line with file and field, on bad content.
    """
    return load_checked(CooperativeConfig, str(filename), "scenario file")
