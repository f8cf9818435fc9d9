"""Effect `downwash`: the jet of a vehicle that flies above."""

import dataclasses as dc
from collections.abc import Sequence

import numpy as np

from np_drake.effects.base import Motion, Parameter, WrenchEffect, arm
from np_drake.effects.rotor_inflow import AIR_DENSITY, RotorInflow
from np_drake.flight_log import Neighbour
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle

# Growth of the width over the way. Half of the centreline velocity is at 0.094 to 0.1 of the
# distance from the axis of a round jet, sqrt(ln 2) of the width. Source: Pope, Turbulent Flows
# (2000), section 5.1.
SPREADING = 0.114  # [1]
SLOPE = RotorInflow().slope  # lift slope times solidity of a rotor, the prior of `rotor_inflow` [1]


@dc.dataclass(frozen=True)
class Downwash(WrenchEffect):
    """Push of the jets of neighbours that hover above: `strength` (drag + loss of thrust).

    Jet of a neighbour, straight down from its p, z below it and r from its axis: w = w_c exp(-(r /
    b)²) with b = b_0 + 0.114 z and w_c = sqrt(2 T / (pi rho)) / b, so that the momentum pi rho b²
    w_c² / 2 is its thrust T at every z. b_0² = 2 arm² + R²: at z = 0 the momentum has the second
    moment about the axis of that of four rotors, each of radius R. Jets add up. Drag: 0.5 rho S w²
    down in W at Bo, S = arm². Loss of thrust of a rotor in the jet at its place, as of a climb: k
    omega_i (w / 2 + sqrt(w² / 4 + v_h²) - v_h) with k and v_h of `rotor_inflow` at its usual slope;
    it levers roll and pitch.

    Prior: a strength of one, the theory.
    Source: momentum theory; round turbulent jet (Pope, Turbulent Flows, 2000); that a quadrotor's
        flow becomes one some diameters below: Bauersfeld et al., Robotics Meets Fluid Dynamics,
        2025. Own choices: the neighbour is built as this vehicle and hovers; its jet follows at
        once; a flat plate of area S; nothing above a rotor.
    """

    strength: float = 1.0  # [1]
    neighbours: tuple[Neighbour, ...] = ()  # whose jets they are; in a diagnosis those of each log

    role = "neighbour"
    named = "the downwash of a neighbour"
    phrase = "a neighbour's downwash of {strength} of theory"
    shares = True
    bench_check = "fly the same path without the neighbour"
    excited_by = "hover one to ten rotor diameters below the neighbour, and pass through its axis"
    begins = False
    widens = False
    parameters = (Parameter("strength", "1", 0.0, 0.0, 3.0, 1.0),)

    def near(self, neighbours: Sequence[Neighbour]) -> "Downwash":
        """Return the effect of these neighbours."""
        return dc.replace(self, neighbours=tuple(neighbours))

    def lacking(self) -> str:
        """Return what a simulation lacks: a neighbour."""
        return "" if self.neighbours else "the path of a neighbour; Downwash.near adds it in Python"

    def body_wrench(self, vehicle: Vehicle, motion: Motion) -> np.ndarray:
        """Return the push in B, (..., 6) [N, N·m]."""
        arms = vehicle.rotor_positions_B
        p_WR = motion.x[..., None, P] + arms @ np.swapaxes(motion.R_WB, -1, -2)
        w = self.velocity(vehicle, motion.t, p_WR)
        out = super().body_wrench(vehicle, motion)
        loss = self.strength * thrust_loss(vehicle, np.maximum(motion.rotor_thrust, 0.0), w)
        out[..., 2] = -np.sum(loss, axis=-1)
        out[..., 3] = -loss @ arms[:, 1]
        out[..., 4] = loss @ arms[:, 0]
        at_centre = self.velocity(vehicle, motion.t, motion.x[..., None, P])
        push = self.strength * 0.5 * AIR_DENSITY * arm(vehicle) ** 2 * at_centre**2
        out[..., :3] -= push * motion.R_WB[..., 2, :]  # downwards
        return out

    def velocity(self, vehicle: Vehicle, t: np.ndarray | float, p_WP: np.ndarray) -> np.ndarray:
        """Return the velocity of all jets downwards (..., m) [m/s]; 0 where no neighbour is known.

        Args:
            t: (...,) [s].
            p_WP: (..., m, 3) points in W [m].
        """
        total = np.zeros(p_WP.shape[:-1])
        for neighbour in self.neighbours:
            away = neighbour.at(t)[..., None, :] - p_WP
            total += jet_velocity(vehicle, away[..., 2], np.hypot(away[..., 0], away[..., 1]))
        return total


def jet_velocity(vehicle: Vehicle, below: np.ndarray, aside: np.ndarray) -> np.ndarray:
    """Return the velocity (...) in the jet of a hovering vehicle, downwards [m/s]; 0 above it, or
    where NaN is given.

    Args:
        below: (...) distance below it [m].
        aside: (...) distance from its axis [m].
    """
    width = np.sqrt(2.0 * arm(vehicle) ** 2 + vehicle.rotor_radius**2) + SPREADING * np.maximum(
        below, 0.0
    )
    centre = np.sqrt(2.0 * vehicle.mass * vehicle.gravity / (np.pi * AIR_DENSITY)) / width
    return np.where(below > 0, centre * np.exp(-((aside / width) ** 2)), 0.0)


def thrust_loss(vehicle: Vehicle, thrust: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return the loss (...) of thrust of rotors with this thrust (...) in a flow w (...) down
    through their discs [N].

    Args:
        thrust: without the flow, not negative [N].
        w: velocity of the flow [m/s].
    """
    area = np.pi * vehicle.rotor_radius**2
    at_rest = np.sqrt(thrust / (2.0 * AIR_DENSITY * area))
    k = SLOPE * AIR_DENSITY * area * vehicle.rotor_radius / 4.0
    speed = np.sqrt(thrust / vehicle.thrust_coefficient)
    return k * speed * (0.5 * w + np.sqrt(0.25 * w**2 + at_rest**2) - at_rest)
