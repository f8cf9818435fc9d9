"""What the MPC decides on, rotor thrusts or body rates with collective thrust, and how that turns
the vehicle.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np

from np_drake.mpc.problem import COMMANDS, MpcConfig
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop


@dc.dataclass(frozen=True)
class Actuation:
    """Decision T (4,) of a stage, its input u = mixer T [N, N·m] and the rotation that u drives.

        dw/dt = J^-1 (tau_m + tau_e - w x (J_free w)) - damping w

    rotors: T are the rotor thrusts, J_free = J, no damping.
    rates: T = [collective thrust, commanded body rates]; a rate loop damps by 1 / lag, is driven by
    tau_m = J gain w_c / lag, and makes up for the gyroscopic torque itself: J_free = 0.
    """

    mixer: np.ndarray  # (4, 4)
    lower: np.ndarray  # (4,) of T [N | N, rad/s]
    upper: np.ndarray  # (4,)
    J_free: np.ndarray  # (3, 3) [kg·m²]
    J_inv: np.ndarray  # (3, 3) [1/(kg·m²)]
    damping: np.ndarray  # (3,) [1/s]
    loop: RateLoop | None = None

    @classmethod
    def of(cls, vehicle: Vehicle, command: str = "rotors") -> "Actuation":
        """Return the actuation of a vehicle.

        Args:
            command: of `COMMANDS`.
        Raises: ValueError: where the vehicle file names no rate loop, and rates are to be
            commanded.
        """
        J_inv, top = np.linalg.inv(vehicle.J), vehicle.max_rotor_thrust
        if command not in COMMANDS:
            raise ValueError(
                f"Actuation: command must be one of {', '.join(COMMANDS)}; got {command!r}."
            )
        if command == "rotors":
            J = np.ascontiguousarray(vehicle.J, float)
            return cls(
                np.ascontiguousarray(vehicle.mixer),
                np.zeros(4),
                np.full(4, top),
                J,
                J_inv,
                np.zeros(3),
            )
        loop = vehicle.rate_loop
        if loop is None:
            raise ValueError(
                f"Actuation: vehicle {vehicle.name!r} must have a rate_loop for commanded "
                f"body rates; it has none."
            )
        mixer, most = np.eye(4), np.array(loop.max_rate, float)
        mixer[1:, 1:] = vehicle.J @ np.diag(np.array(loop.gain) / np.array(loop.lag))
        return cls(
            mixer,
            np.array([0.0, *-most]),
            np.array([4 * top, *most]),
            np.zeros((3, 3)),
            J_inv,
            1 / np.array(loop.lag, float),
            loop,
        )

    def input_weights(self, config: MpcConfig) -> np.ndarray:
        """Return the diagonal weight (4,) of u [1/N², 1/(N·m)²].

        Args:
            config: whose `weight_rates` is the price of commanded rates, and `weight_input` that of
                all else.
        """
        if self.loop is None:
            return config.R
        return np.array([config.R[0], *(config.weight_rates / np.square(np.diag(self.mixer)[1:]))])

    @cached_property
    def unmixer(self) -> np.ndarray:
        """Map (4, 4) from u to T."""
        return np.linalg.inv(self.mixer)

    def clip(self, T: np.ndarray) -> np.ndarray:
        """Return T (..., 4) within its bounds."""
        return np.minimum(np.maximum(T, self.lower), self.upper)

    def saturate(self, u: np.ndarray) -> np.ndarray:
        """Return the input u (..., 4) whose T is the nearest within its bounds [N, N·m]."""
        return self.clip(u @ self.unmixer.T) @ self.mixer.T

    def driving(self, vehicle: Vehicle, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the input (..., 4) that gives the motion which eq. (1) has under thrust and torque
        [N, N·m].

        Args:
            x: (..., 13) states.
            u: (..., 4) thrust and torque [N, N·m].
        """
        if self.loop is None:
            return u
        w = x[..., 10:13]
        al = (u[..., 1:] - np.cross(w, w @ vehicle.J.T)) @ self.J_inv.T
        T = np.concatenate([u[..., :1], self.loop.command(w, al)], axis=-1)
        return T @ self.mixer.T
