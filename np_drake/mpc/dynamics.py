"""What the MPC decides on and how that turns the vehicle, and the discrete nominal dynamics with
their Jacobians for all stages at once; the loops are compiled.

Rotation r = (q, w) drives translation and not the other way round, and its rate is a homogeneous
quadratic of r plus J^-1 tau; so q' depends on q and w, w' on w alone, and p', v' on the body z axis
of the stages of Runge and Kutta.
"""

import dataclasses as dc
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from np_drake.compiled import compiled, times
from np_drake.mpc.problem import COMMANDS, MpcConfig
from np_drake.rigid_body import STATE_SIZE
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop

_AHEAD = (0.5, 0.5, 1.0, 0.0)  # of a step, from one stage of Runge and Kutta to the next [1]
_WEIGHT_V = (1.0, 2.0, 2.0, 1.0)  # of the stages in the velocity, over 6 [1]
_WEIGHT_P = (1.0, 1.0, 1.0, 0.0)  # of the stages in the position, over 6 [1]


@dc.dataclass(frozen=True)
class Actuation:
    """Decision T (4,) of a stage, its input u = mixer T [N, N·m] and the rotation that u drives.

        dw/dt = J^-1 (tau_m + tau_e - w x (J_free w)) - damping w

    rotors: T are the rotor thrusts, J_free = J, no damping.
    rates: T = [collective thrust, commanded body rates]; a rate loop damps by 1 / lag, is driven by
    tau_m = J gain w_c / lag, and makes up for the gyroscopic torque itself: J_free = 0.

    rotor_lag: time constant with which the rotors follow T, none under a rate loop [s].
    """

    mixer: np.ndarray  # (4, 4)
    lower: np.ndarray  # (4,) of T [N | N, rad/s]
    upper: np.ndarray  # (4,)
    J_free: np.ndarray  # (3, 3) [kg·m²]
    J_inv: np.ndarray  # (3, 3) [1/(kg·m²)]
    damping: np.ndarray  # (3,) [1/s]
    loop: RateLoop | None = None
    rotor_lag: float = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, command: str = "rotors") -> "Actuation":
        """Return the actuation of a vehicle.

        Args:
            command: of `COMMANDS`.
        Raises: ValueError: where the vehicle file names no rate loop, and rates are to be
            commanded.
        """
        J_inv = np.linalg.inv(vehicle.J)
        top = vehicle.max_rotor_thrust
        if command not in COMMANDS:
            raise ValueError(
                f"Actuation: command must be one of {', '.join(COMMANDS)}; got {command!r}."
            )
        if command == "rotors":
            return cls(
                np.ascontiguousarray(vehicle.mixer),
                np.zeros(4),
                np.full(4, top),
                np.ascontiguousarray(vehicle.J, float),
                J_inv,
                np.zeros(3),
                rotor_lag=vehicle.rotor_time_constant,
            )
        loop = vehicle.rate_loop
        if loop is None:
            raise ValueError(
                f"Actuation: vehicle {vehicle.name!r} must have a rate_loop for commanded "
                f"body rates; it has none."
            )
        mixer = np.eye(4)
        most = np.array(loop.max_rate, float)
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


@dc.dataclass(frozen=True)
class Linearisation:
    """Jacobians Fx = dF/d[x, chi] (N, 13, 19) and Fu = dF/du (N, 13, 4) of the discrete
    dynamics.
    """

    Fx: np.ndarray
    Fu: np.ndarray


class DiscreteDynamics:
    """Discrete dynamics x_(i+1) = RK4(x_i, u_i, chi_i; step), input and wrench held over the step.

    Source: Jin et al. 2025, eq. (1); classical Runge-Kutta, own choice. The quaternion is not
    renormalised: its drift over a horizon is of the integrator's order, and every solver shares it.

    Args:
        step: [s].
        actuation: how the input turns the vehicle; default: by the torque of its rotors.
    """

    def __init__(self, vehicle: Vehicle, step: float, actuation: Actuation | None = None):
        self.vehicle = vehicle
        self.step = step
        by = actuation or Actuation.of(vehicle)
        self._body = (
            float(step),
            float(vehicle.mass),
            float(vehicle.gravity),
            by.J_free,
            by.J_inv,
            by.damping,
        )

    def linearise(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray) -> Linearisation:
        """Return the Jacobians at N stages.

        Args:
            x: (N, 13) states.
            u: (N, 4) inputs [N, N·m].
            chi: (N, 6) wrenches [N, N·m].
        """
        n = len(x)
        result = Linearisation(np.zeros((n, STATE_SIZE, 19)), np.zeros((n, STATE_SIZE, 4)))
        x, u, chi = (np.ascontiguousarray(value, float) for value in (x, u, chi))
        step, mass, _, *rotation = self._body  # gravity is in no Jacobian
        _linearise(x, u, chi, step, mass, *rotation, result.Fx, result.Fu)
        return result

    def advance(self, x: ArrayLike, u: ArrayLike, chi: ArrayLike) -> np.ndarray:
        """Return the state (13,) after one step.

        Args:
            x: (13,) state.
            u: (4,) input [N, N·m].
            chi: (6,) wrench [N, N·m].
        """
        after = np.empty(STATE_SIZE)
        _advance(*(np.asarray(value, float) for value in (x, u, chi)), *self._body, after)
        return after

    def rollout(self, x: np.ndarray, u: np.ndarray, chi: np.ndarray, markov: np.ndarray) -> None:
        """Write the states after x_0 to x (N+1, 13), and add to chi (N, 6) what the motion drives
        [N, N·m].

        Args:
            x: (N+1, 13), whose first row is given.
            u: (N, 4) [N, N·m].
            chi: (N, 6) wrench without the motion's part [N, N·m].
            markov: (6, 6(N-1)) of `Horizon`, or (6, 0).
        """
        _rollout(x, u, chi, markov, *self._body)


@compiled
def _advance(x, u, chi, step, mass, gravity, J, J_inv, damping, out):
    """Write the state (13,) after one step of Runge and Kutta into `out`; u (4,) [N, N·m], chi (6,)
    [N, N·m].
    """
    w = x[3]
    i = x[4]
    j = x[5]
    k = x[6]
    a = x[10]
    b = x[11]
    c = x[12]
    tau_x = u[1] + chi[3]
    tau_y = u[2] + chi[4]
    tau_z = u[3] + chi[5]
    vx = vy = vz = px = py = pz = 0.0
    sw = si = sj = sk = sa = sb = sc = 0.0
    for stage in range(4):
        weight = _WEIGHT_V[stage]
        in_p = _WEIGHT_P[stage]
        zx = 2 * (i * k + w * j)
        zy = 2 * (j * k - w * i)
        zz = w * w - i * i - j * j + k * k
        hx, hy, hz = times(J, a, b, c)
        tx = tau_x - b * hz + c * hy
        ty = tau_y - c * hx + a * hz
        tz = tau_z - a * hy + b * hx
        da, db, dc = times(J_inv, tx, ty, tz)
        da = da - damping[0] * a
        db = db - damping[1] * b
        dc = dc - damping[2] * c
        dw = 0.5 * (-i * a - j * b - k * c)
        di = 0.5 * (w * a + j * c - k * b)
        dj = 0.5 * (w * b + k * a - i * c)
        dk = 0.5 * (w * c + i * b - j * a)
        vx = vx + weight * zx
        vy = vy + weight * zy
        vz = vz + weight * zz
        px = px + in_p * zx
        py = py + in_p * zy
        pz = pz + in_p * zz
        sw = sw + weight * dw
        si = si + weight * di
        sj = sj + weight * dj
        sk = sk + weight * dk
        sa = sa + weight * da
        sb = sb + weight * db
        sc = sc + weight * dc
        h = _AHEAD[stage] * step
        w = x[3] + h * dw
        i = x[4] + h * di
        j = x[5] + h * dj
        k = x[6] + h * dk
        a = x[10] + h * da
        b = x[11] + h * db
        c = x[12] + h * dc
    # Runge and Kutta: x + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4); for p it is h v + h²/6 (a_1 + a_2 + a_3)
    sixth = step / 6
    half = step * step / 2
    f_v = sixth * u[0] / mass
    f_p = step * sixth * u[0] / mass
    ax = chi[0] / mass
    ay = chi[1] / mass
    az = chi[2] / mass - gravity
    out[0] = x[0] + step * x[7] + f_p * px + half * ax
    out[1] = x[1] + step * x[8] + f_p * py + half * ay
    out[2] = x[2] + step * x[9] + f_p * pz + half * az
    out[3] = x[3] + sixth * sw
    out[4] = x[4] + sixth * si
    out[5] = x[5] + sixth * sj
    out[6] = x[6] + sixth * sk
    out[7] = x[7] + f_v * vx + step * ax
    out[8] = x[8] + f_v * vy + step * ay
    out[9] = x[9] + f_v * vz + step * az
    out[10] = x[10] + sixth * sa
    out[11] = x[11] + sixth * sb
    out[12] = x[12] + sixth * sc


@compiled
def _respond(x, markov, i, chi):
    """Add to chi (6,) what zeta of x_0 … x_(i-1), x (N+1, 13), drives at stage i; markov: (6,
    6(N-1)) of `Horizon`.
    """
    a = b = c = d = e = f = 0.0
    at = markov.shape[1] - 6 * i
    for j in range(i):
        for s in range(6):
            zeta = x[j, 7 + s]
            a = a + markov[0, at] * zeta
            b = b + markov[1, at] * zeta
            c = c + markov[2, at] * zeta
            d = d + markov[3, at] * zeta
            e = e + markov[4, at] * zeta
            f = f + markov[5, at] * zeta
            at += 1
    chi[0], chi[1], chi[2] = chi[0] + a, chi[1] + b, chi[2] + c
    chi[3], chi[4], chi[5] = chi[3] + d, chi[4] + e, chi[5] + f


@compiled
def _rollout(x, u, chi, markov, step, mass, gravity, J, J_inv, damping):
    """Write x_1 … x_N of the states x (N+1, 13) under u (N, 4), and add to chi (N, 6) what the
    motion drives.
    """
    n = len(u)
    known = markov.shape[1]
    for i in range(n):
        if known:
            _respond(x, markov, i, chi[i])
        _advance(x[i], u[i], chi[i], step, mass, gravity, J, J_inv, damping, x[i + 1])


@compiled
def _linearise(x, u, chi, step, mass, J, J_inv, damping, Fx, Fu):
    """Write the Jacobians over [x, chi] (N, 13, 19) and u (N, 13, 4), which come zeroed, of a step
    from each x (N, 13).
    """
    D = np.zeros((7, 10))  # d(q, w) of the current stage over (q, w, tau) at its start
    rate = np.zeros((7, 10))
    total = np.zeros((7, 10))
    M = np.zeros((7, 7))
    turn = np.zeros((3, 3))
    z = np.zeros((3, 10))
    in_v = np.zeros((3, 10))
    in_p = np.zeros((3, 10))
    sixth = step / 6
    for n in range(len(x)):
        r = np.zeros(7)
        r[:4] = x[n, 3:7]
        r[4:] = x[n, 10:13]
        start = r.copy()
        D[:] = 0.0
        total[:] = 0.0
        in_v[:] = 0.0
        in_p[:] = 0.0
        axis_v = np.zeros(3)
        axis_p = np.zeros(3)
        for c in range(7):
            D[c, c] = 1.0
        for stage in range(4):
            w = r[0]
            i = r[1]
            j = r[2]
            k = r[3]
            a = r[4]
            b = r[5]
            c_ = r[6]
            _rotation_jacobian(r, J, J_inv, damping, M, turn)
            for row in range(7):
                rate[row] = 0.0
                for s in range(7) if row < 4 else range(4, 7):
                    for col in range(10):
                        rate[row, col] += M[row, s] * D[s, col]
            for row in range(3):
                for col in range(3):
                    rate[4 + row, 7 + col] += J_inv[row, col]
            axis = (2 * (i * k + w * j), 2 * (j * k - w * i), w * w - i * i - j * j + k * k)
            for col in range(10):
                dw = D[0, col]
                di = D[1, col]
                dj = D[2, col]
                dk = D[3, col]
                z[0, col] = 2 * (j * dw + k * di + w * dj + i * dk)
                z[1, col] = 2 * (-i * dw - w * di + k * dj + j * dk)
                z[2, col] = 2 * (w * dw - i * di - j * dj + k * dk)
            weight = _WEIGHT_V[stage]
            weight_p = _WEIGHT_P[stage]
            ahead = _AHEAD[stage] * step
            for row in range(3):
                axis_v[row] += weight * axis[row]
                axis_p[row] += weight_p * axis[row]
                for col in range(10):
                    in_v[row, col] += weight * z[row, col]
                    in_p[row, col] += weight_p * z[row, col]
            hx, hy, hz = times(J, a, b, c_)
            tx = u[n, 1] + chi[n, 3] - b * hz + c_ * hy
            ty = u[n, 2] + chi[n, 4] - c_ * hx + a * hz
            tz = u[n, 3] + chi[n, 5] - a * hy + b * hx
            rate_now = (a, b, c_)
            r[0] = start[0] + ahead * 0.5 * (-i * a - j * b - k * c_)
            r[1] = start[1] + ahead * 0.5 * (w * a + j * c_ - k * b)
            r[2] = start[2] + ahead * 0.5 * (w * b + k * a - i * c_)
            r[3] = start[3] + ahead * 0.5 * (w * c_ + i * b - j * a)
            for row in range(3):
                turned = J_inv[row, 0] * tx + J_inv[row, 1] * ty + J_inv[row, 2] * tz
                r[4 + row] = start[4 + row] + ahead * (turned - damping[row] * rate_now[row])
            for row in range(7):
                for col in range(10):
                    total[row, col] += weight * rate[row, col]
                    D[row, col] = ahead * rate[row, col]
                D[row, row] += 1.0
        push_v = sixth * u[n, 0] / mass
        push_p = step * sixth * u[n, 0] / mass
        for row in range(3):
            Fx[n, row, row] = 1.0
            Fx[n, row, 7 + row] = step
            Fx[n, 7 + row, 7 + row] = 1.0
            Fx[n, row, 13 + row] = 0.5 * step * step / mass
            Fx[n, 7 + row, 13 + row] = step / mass
            Fu[n, row, 0] = step * sixth * axis_p[row] / mass
            Fu[n, 7 + row, 0] = sixth * axis_v[row] / mass
            _place(Fx[n, row], Fu[n, row], in_p[row], push_p)
            _place(Fx[n, 7 + row], Fu[n, 7 + row], in_v[row], push_v)
            _place(Fx[n, 10 + row], Fu[n, 10 + row], total[4 + row], sixth)
            Fx[n, 10 + row, 10 + row] += 1.0
        for row in range(4):
            _place(Fx[n, 3 + row], Fu[n, 3 + row], total[row], sixth)
            Fx[n, 3 + row, 3 + row] += 1.0


@compiled
def _place(row_x, row_u, over, factor):
    """Write `factor` times the derivatives over (q, w, tau) (10,) to a row over [x, chi] and one
    over u.
    """
    for col in range(4):
        row_x[3 + col] = factor * over[col]
    for col in range(3):
        row_x[10 + col] = factor * over[4 + col]
        row_x[16 + col] = factor * over[7 + col]
        row_u[1 + col] = factor * over[7 + col]


@compiled
def _rotation_jacobian(r, J, J_inv, damping, M, turn):
    """Write the Jacobian M (7, 7) of the rate of (q, w) at r (7,); `turn` (3, 3) is a workspace."""
    w = r[0]
    i = r[1]
    j = r[2]
    k = r[3]
    a = r[4]
    b = r[5]
    c = r[6]
    M[0, 1] = -0.5 * a
    M[0, 2] = -0.5 * b
    M[0, 3] = -0.5 * c
    M[1, 0] = 0.5 * a
    M[1, 2] = 0.5 * c
    M[1, 3] = -0.5 * b
    M[2, 0] = 0.5 * b
    M[2, 1] = -0.5 * c
    M[2, 3] = 0.5 * a
    M[3, 0] = 0.5 * c
    M[3, 1] = 0.5 * b
    M[3, 2] = -0.5 * a
    M[0, 4] = -0.5 * i
    M[0, 5] = -0.5 * j
    M[0, 6] = -0.5 * k
    M[1, 4] = 0.5 * w
    M[1, 5] = -0.5 * k
    M[1, 6] = 0.5 * j
    M[2, 4] = 0.5 * k
    M[2, 5] = 0.5 * w
    M[2, 6] = -0.5 * i
    M[3, 4] = -0.5 * j
    M[3, 5] = 0.5 * i
    M[3, 6] = 0.5 * w
    hx, hy, hz = times(J, a, b, c)
    for col in range(3):  # -(w x J - (J w) x)
        turn[0, col] = c * J[1, col] - b * J[2, col]
        turn[1, col] = a * J[2, col] - c * J[0, col]
        turn[2, col] = b * J[0, col] - a * J[1, col]
    turn[0, 1] -= hz
    turn[0, 2] += hy
    turn[1, 0] += hz
    turn[1, 2] -= hx
    turn[2, 0] -= hy
    turn[2, 1] += hx
    for row in range(3):
        for col in range(3):
            M[4 + row, 4 + col] = (
                J_inv[row, 0] * turn[0, col]
                + J_inv[row, 1] * turn[1, col]
                + J_inv[row, 2] * turn[2, col]
            )
        M[4 + row, 4 + row] -= damping[row]
