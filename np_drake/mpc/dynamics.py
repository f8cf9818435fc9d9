"""Discrete nominal dynamics inside the MPC, and their Jacobians for all stages at once; the loops are compiled."""

import dataclasses as dc

import numpy as np
from numpy.typing import ArrayLike

from np_drake.mpc.kernels import dynamics as kernel
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle


@dc.dataclass(frozen=True)
class Linearisation:
    """Arrays x_next (N, 13), Fx = dF/d[x, chi] (N, 13, 19) and Fu = dF/du (N, 13, 4) of the discrete dynamics."""

    x_next: np.ndarray
    Fx: np.ndarray
    Fu: np.ndarray


class DiscreteDynamics:
    """Discrete dynamics x_(i+1) = RK4(x_i, u_i, chi_i; step), input and wrench held over the step.

    Source: Jin et al. 2025, eq. (1); classical Runge-Kutta, own choice. The quaternion is not renormalised:
    its drift over a horizon is of the integrator's order, and every solver shares it.
    """

    def __init__(self, vehicle: Vehicle, step: float):
        self.vehicle, self.step = vehicle, step
        J = np.ascontiguousarray(vehicle.J, float)
        self._body = (float(step), float(vehicle.mass), float(vehicle.gravity), J, np.linalg.inv(J))

    def linearise(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> Linearisation:
        """Return value and Jacobians at N stages.

        Args:    x: (N, 13) states.   u: (N, 4) inputs [N, N·m].   chi: (N, 6) wrenches [N, N·m].
        """
        n = len(x)
        result = Linearisation(
            np.empty((n, STATE_SIZE)), np.zeros((n, STATE_SIZE, 19)), np.zeros((n, STATE_SIZE, 4))
        )
        x, u, chi = (np.ascontiguousarray(value, float) for value in (x, u, chi))
        kernel.linearise(x, u, chi, *self._body, result.x_next, result.Fx, result.Fu)
        return result

    def advance(self, x: ArrayLike, u: ArrayLike, chi: ArrayLike) -> np.ndarray:
        """Return the state (13,) after one step.

        Args: x: (13,).   u: (4,) [N, N·m].   chi: (6,) [N, N·m].
        """
        after = np.empty(STATE_SIZE)
        kernel.advance(*(np.asarray(value, float) for value in (x, u, chi)), *self._body, after)
        return after

    def rollout(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray, markov: np.ndarray) -> None:
        """Write the states after x_0 to x (N+1, 13), and add to chi (N, 6) what the motion drives [N, N·m].

        Args: u: (N, 4) [N, N·m].   markov: (6, 6(N-1)) of `Horizon`, or (6, 0).
        """
        kernel.rollout(x, u, chi, markov, *self._body)
