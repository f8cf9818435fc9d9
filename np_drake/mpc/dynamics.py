"""Discrete nominal dynamics inside the MPC, and their Jacobians for all stages at once.

Rotation r = (q, w) drives translation and not the other way round, and dr/dt is a homogeneous quadratic of r
plus J^-1 tau. One constant tensor therefore gives value and Jacobian together, M(r) = d(dr/dt)/dr and
dr/dt = M(r) r / 2; the same holds for the body z axis in q.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence

import numpy as np

from np_drake import attitude
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle

_STAGES = ((0.5, 1.0, 1.0), (0.5, 2.0, 1.0), (1.0, 2.0, 1.0), (0.0, 1.0, 0.0))  # ahead, weight in v, in p


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
        self.vehicle = vehicle
        self.step = step
        self._J_inv = np.linalg.inv(vehicle.J)
        self._rotation = _gradient_tensor(self._free_rotation, 7)
        self._body_z = _gradient_tensor(attitude.body_z, 4)
        self._spin, self._principal = _angular_acceleration(vehicle.J), _principal_axes(vehicle.J)

    def _free_rotation(self, r: np.ndarray) -> np.ndarray:
        w = r[4:]
        return np.concatenate(
            [attitude.quaternion_rate(r[:4], w), -self._J_inv @ np.cross(w, self.vehicle.J @ w)]
        )

    def linearise(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> Linearisation:
        """Return value and Jacobians at N stages.

        Args:    x: (N, 13) states.   u: (N, 4) inputs [N, N·m].   chi: (N, 6) wrenches [N, N·m].
        """
        h, n = self.step, len(x)
        r0 = np.concatenate([x[:, 3:7], x[:, 10:13]], axis=1)
        push = np.zeros(
            (n, 7, 11)
        )  # what dr/dt gains from tau: columns 7:10 its Jacobian, column 10 its value
        push[:, 4:, 7:10] = self._J_inv
        push[:, 4:, 10] = (u[:, 1:4] + chi[:, 3:6]) @ self._J_inv.T
        start = np.zeros((n, 7, 11))  # [dr/d(q, w, tau) | r] of the current Runge-Kutta stage
        start[:, range(7), range(7)] = 1.0
        start[:, :, 10] = r0
        stage, total = start, np.zeros((n, 7, 11))
        quaternions = np.empty((4, n, 4, 11))
        for k, (ahead, weight, _) in enumerate(_STAGES):
            quaternions[k] = stage[:, :4]
            slope = (stage[:, :, 10] @ self._rotation).reshape(n, 7, 7) @ stage
            slope[:, :, 10] *= 0.5
            slope += push
            total += weight * slope
            if ahead:
                stage = start + (ahead * h) * slope
        return self._assemble(x, u, chi, start + (h / 6) * total, quaternions)

    def _assemble(self, x, u, chi, rotation, quaternions) -> Linearisation:
        """Join rotation (N, 7, 11) with translation from the four stage quaternions (4, N, 4, 11)."""
        h, n, m = self.step, len(x), self.vehicle.mass
        axes = (quaternions[..., 10] @ self._body_z).reshape(4, n, 3, 4) @ quaternions
        axes[..., 10] *= 0.5
        dv = (axes[0] + 2 * (axes[1] + axes[2]) + axes[3]) * (h / 6 / m)
        dp = (axes[0] + axes[1] + axes[2]) * (h * h / 6 / m)
        force = chi[:, :3] / m - [0.0, 0.0, self.vehicle.gravity]
        thrust = u[:, :1]
        x_next = np.empty((n, STATE_SIZE))
        x_next[:, 0:3] = x[:, 0:3] + h * x[:, 7:10] + thrust * dp[..., 10] + (h * h / 2) * force
        x_next[:, 3:7] = rotation[:, :4, 10]
        x_next[:, 7:10] = x[:, 7:10] + thrust * dv[..., 10] + h * force
        x_next[:, 10:13] = rotation[:, 4:, 10]
        full = np.zeros((n, STATE_SIZE, 10))  # columns q, w, tau
        full[:, 0:3] = thrust[:, :, None] * dp[..., :10]
        full[:, 3:7] = rotation[:, :4, :10]
        full[:, 7:10] = thrust[:, :, None] * dv[..., :10]
        full[:, 10:13] = rotation[:, 4:, :10]
        Fx = np.zeros((n, STATE_SIZE, 19))
        Fx[:, :, 3:7] = full[:, :, :4]
        Fx[:, :, 10:13] = full[:, :, 4:7]
        Fx[:, :, 16:19] = full[:, :, 7:]
        for i in range(3):
            Fx[:, i, i] = Fx[:, 7 + i, 7 + i] = 1.0
            Fx[:, i, 7 + i] = h
            Fx[:, i, 13 + i] = h * h / 2 / m
            Fx[:, 7 + i, 13 + i] = h / m
        Fu = np.zeros((n, STATE_SIZE, 4))
        Fu[:, 0:3, 0] = dp[..., 10]
        Fu[:, 7:10, 0] = dv[..., 10]
        Fu[:, :, 1:] = full[:, :, 7:]
        return Linearisation(x_next, Fx, Fu)

    def advance(self, x: Sequence[float], u: Sequence[float], chi: Sequence[float]) -> list[float]:
        """Return the state after one step in plain floats, several times faster than NumPy for a single state.

        Args: x: 13 entries.   u: 4 [N, N·m].   chi: 6 [N, N·m].
        """
        px, py, pz, w0, x0, y0, z0, vx, vy, vz, a0, b0, c0 = x
        h, m = self.step, self.vehicle.mass
        thrust = u[0] / m
        spin, torque = self._spin, (u[1] + chi[3], u[2] + chi[4], u[3] + chi[5])
        if self._principal:  # three times as fast as the call
            ia, ib, ic, ka, kb, kc = self._principal
            ta, tb, tc = ia * torque[0], ib * torque[1], ic * torque[2]
        w, i, j, k, a, b, c = w0, x0, y0, z0, a0, b0, c0
        dvx = dvy = dvz = dpx = dpy = dpz = dw = di = dj = dk = da = db = dc_ = 0.0
        for ahead, weight, in_p in _STAGES:
            zx, zy, zz = 2 * (i * k + w * j), 2 * (j * k - w * i), w * w - i * i - j * j + k * k
            qw, qi = 0.5 * (-i * a - j * b - k * c), 0.5 * (w * a + j * c - k * b)
            qj, qk = 0.5 * (w * b + k * a - i * c), 0.5 * (w * c + i * b - j * a)
            if self._principal:
                sa, sb, sc = ta + ka * b * c, tb + kb * c * a, tc + kc * a * b
            else:
                sa, sb, sc = spin(a, b, c, torque)
            dvx, dvy, dvz = dvx + weight * zx, dvy + weight * zy, dvz + weight * zz
            dpx, dpy, dpz = dpx + in_p * zx, dpy + in_p * zy, dpz + in_p * zz
            dw, di, dj, dk = dw + weight * qw, di + weight * qi, dj + weight * qj, dk + weight * qk
            da, db, dc_ = da + weight * sa, db + weight * sb, dc_ + weight * sc
            s = ahead * h
            w, i, j, k = w0 + s * qw, x0 + s * qi, y0 + s * qj, z0 + s * qk
            a, b, c = a0 + s * sa, b0 + s * sb, c0 + s * sc
        s, sv, sp, half = h / 6, h / 6 * thrust, h * h / 6 * thrust, h * h / 2
        ax, ay, az = chi[0] / m, chi[1] / m, chi[2] / m - self.vehicle.gravity
        return [
            *(px + h * vx + sp * dpx + half * ax, py + h * vy + sp * dpy + half * ay),
            *(pz + h * vz + sp * dpz + half * az, w0 + s * dw, x0 + s * di, y0 + s * dj, z0 + s * dk),
            *(vx + sv * dvx + h * ax, vy + sv * dvy + h * ay, vz + sv * dvz + h * az),
            *(a0 + s * da, b0 + s * db, c0 + s * dc_),
        ]


def _gradient_tensor(f: Callable[[np.ndarray], np.ndarray], size: int) -> np.ndarray:
    """Return T (size, m*size), (r @ T).reshape(m, size) = df/dr, for a homogeneous quadratic f of r (size,)."""
    e = np.eye(size)
    columns = [[f(e[j] + e[k]) - f(e[j]) - f(e[k]) for j in range(size)] for k in range(size)]
    return np.moveaxis(np.array(columns), 2, 1).reshape(size, -1)


def _principal_axes(J: np.ndarray) -> tuple[float, ...]:
    """Return 1/J_i and (J_j - J_k)/J_i for i = x, y, z of a diagonal inertia; empty for another."""
    if np.count_nonzero(J - np.diag(np.diag(J))):
        return ()
    x, y, z = np.diag(J).tolist()
    return 1 / x, 1 / y, 1 / z, (y - z) / x, (z - x) / y, (x - y) / z


def _angular_acceleration(J: np.ndarray) -> Callable[..., tuple[float, float, float]]:
    """Return dw/dt = J^-1 (torque - w x J w) in plain floats [rad/s²]."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = J.tolist()
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = np.linalg.inv(J).tolist()

    def general(a, b, c, torque):
        h1, h2, h3 = xx * a + xy * b + xz * c, xy * a + yy * b + yz * c, xz * a + yz * b + zz * c
        t1, t2, t3 = torque[0] - b * h3 + c * h2, torque[1] - c * h1 + a * h3, torque[2] - a * h2 + b * h1
        return (
            ixx * t1 + ixy * t2 + ixz * t3,
            ixy * t1 + iyy * t2 + iyz * t3,
            ixz * t1 + iyz * t2 + izz * t3,
        )

    return general
