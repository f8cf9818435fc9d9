"""What the MPC decides on and how that turns the vehicle, and the discrete nominal dynamics with
their Jacobians for all stages at once; the loops are compiled.

Rotation r = (q, w) drives translation and not the other way round, and its rate is a homogeneous
quadratic of r plus J^-1 tau; so q' depends on q and w, w' on w alone, and p', v' on the body z axis
of the stages of Runge and Kutta.
"""

import dataclasses as dc
from functools import cached_property
from typing import NamedTuple

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


class _Body(NamedTuple):
    """Constants of a step: its length [s], and of the body as of `Actuation`."""

    step: float  # [s]
    mass: float  # [kg]
    gravity: float  # [m/s²]
    J: np.ndarray  # (3, 3), J_free [kg·m²]
    J_inv: np.ndarray  # (3, 3) [1/(kg·m²)]
    damping: np.ndarray  # (3,) [1/s]


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
        mass = float(vehicle.mass)
        gravity = float(vehicle.gravity)
        self._body = _Body(float(step), mass, gravity, by.J_free, by.J_inv, by.damping)

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
        _linearise(x, u, chi, self._body, result.Fx, result.Fu)
        return result

    def advance(self, x: ArrayLike, u: ArrayLike, chi: ArrayLike) -> np.ndarray:
        """Return the state (13,) after one step.

        Args:
            x: (13,) state.
            u: (4,) input [N, N·m].
            chi: (6,) wrench [N, N·m].
        """
        after = np.empty(STATE_SIZE)
        _advance(*(np.asarray(value, float) for value in (x, u, chi)), self._body, after)
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
        _rollout(x, u, chi, markov, self._body)


@compiled
def _advance(x, u, chi, body, out):
    """Write the state (13,) after one step of Runge and Kutta into `out`; u (4,) [N, N·m], chi (6,)
    [N, N·m].
    """
    start = (x[3], x[4], x[5], x[6], x[10], x[11], x[12])
    tau = (u[1] + chi[3], u[2] + chi[4], u[3] + chi[5])
    r = start
    turned = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    in_v = (0.0, 0.0, 0.0)
    in_p = (0.0, 0.0, 0.0)
    for stage in range(4):
        rate = _rotation_rate(r, tau, body)
        axis = _thrust_axis(r)
        in_v = _moved_axis(in_v, _WEIGHT_V[stage], axis)
        in_p = _moved_axis(in_p, _WEIGHT_P[stage], axis)
        turned = _moved(turned, _WEIGHT_V[stage], rate)
        r = _moved(start, _AHEAD[stage] * body.step, rate)
    # Runge and Kutta: x + h/6 (k_1 + 2 k_2 + 2 k_3 + k_4); for p it is h v + h²/6 (a_1 + a_2 + a_3)
    step = body.step
    sixth = step / 6
    half = step * step / 2
    f_v = sixth * u[0] / body.mass
    f_p = step * sixth * u[0] / body.mass
    pushed = (chi[0] / body.mass, chi[1] / body.mass, chi[2] / body.mass - body.gravity)
    for row in range(3):
        out[row] = x[row] + step * x[7 + row] + f_p * in_p[row] + half * pushed[row]
        out[7 + row] = x[7 + row] + f_v * in_v[row] + step * pushed[row]
        out[10 + row] = x[10 + row] + sixth * turned[4 + row]
    for row in range(4):
        out[3 + row] = x[3 + row] + sixth * turned[row]


@compiled
def _rotation_rate(r, tau, body):
    """Return the rate of r = (q, w) under the torque tau [N·m]."""
    w, i, j, k, a, b, c = r
    hx, hy, hz = times(body.J, a, b, c)
    tx = tau[0] - b * hz + c * hy
    ty = tau[1] - c * hx + a * hz
    tz = tau[2] - a * hy + b * hx
    da, db, dc = times(body.J_inv, tx, ty, tz)
    return (
        0.5 * (-i * a - j * b - k * c),
        0.5 * (w * a + j * c - k * b),
        0.5 * (w * b + k * a - i * c),
        0.5 * (w * c + i * b - j * a),
        da - body.damping[0] * a,
        db - body.damping[1] * b,
        dc - body.damping[2] * c,
    )


@compiled
def _thrust_axis(r):
    """Return body z in W at r = (q, w)."""
    w = r[0]
    i = r[1]
    j = r[2]
    k = r[3]
    return 2 * (i * k + w * j), 2 * (j * k - w * i), w * w - i * i - j * j + k * k


@compiled
def _moved(r, factor, rate):
    """Return r + factor rate, of seven numbers."""
    return (
        r[0] + factor * rate[0],
        r[1] + factor * rate[1],
        r[2] + factor * rate[2],
        r[3] + factor * rate[3],
        r[4] + factor * rate[4],
        r[5] + factor * rate[5],
        r[6] + factor * rate[6],
    )


@compiled
def _moved_axis(total, factor, axis):
    """Return total + factor axis, of three numbers."""
    return (total[0] + factor * axis[0], total[1] + factor * axis[1], total[2] + factor * axis[2])


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
def _rollout(x, u, chi, markov, body):
    """Write x_1 … x_N of the states x (N+1, 13) under u (N, 4), and add to chi (N, 6) what the
    motion drives.
    """
    known = markov.shape[1]
    for i in range(len(u)):
        if known:
            _respond(x, markov, i, chi[i])
        _advance(x[i], u[i], chi[i], body, x[i + 1])


class _Derivatives(NamedTuple):
    """Derivatives over (q, w, tau) at the start of a step, and workspaces."""

    r: np.ndarray  # (7, 10) of (q, w) at the current stage
    rate: np.ndarray  # (7, 10) of their rate there
    jacobian: np.ndarray  # (7, 7) of that rate over (q, w)
    turned: np.ndarray  # (7, 10) of the weighted rates
    in_v: np.ndarray  # (3, 10) of the weighted thrust axes in the velocity
    in_p: np.ndarray  # (3, 10) in the position
    axis_v: np.ndarray  # (3,) the weighted axes themselves
    axis_p: np.ndarray  # (3,)


@compiled
def _linearise(x, u, chi, body, Fx, Fu):
    """Write the Jacobians over [x, chi] (N, 13, 19) and u (N, 13, 4), which come zeroed, of a step
    from each x (N, 13).
    """
    over = _Derivatives(
        np.zeros((7, 10)),
        np.zeros((7, 10)),
        np.zeros((7, 7)),
        np.zeros((7, 10)),
        np.zeros((3, 10)),
        np.zeros((3, 10)),
        np.zeros(3),
        np.zeros(3),
    )
    for n in range(len(x)):
        _differentiate_turn(x[n], u[n], chi[n], body, over)
        _write_rows(u[n, 0], body, over, Fx[n], Fu[n])


@compiled
def _differentiate_turn(x, u, chi, body, over):
    """Write the derivatives of the stages of one step from x (13,) to `over`."""
    start = (x[3], x[4], x[5], x[6], x[10], x[11], x[12])
    tau = (u[1] + chi[3], u[2] + chi[4], u[3] + chi[5])
    r = start
    for total in (over.r, over.turned, over.in_v, over.in_p):
        total[:] = 0.0
    over.axis_v[:] = 0.0
    over.axis_p[:] = 0.0
    for row in range(7):
        over.r[row, row] = 1.0
    for stage in range(4):
        weight = _WEIGHT_V[stage]
        ahead = _AHEAD[stage] * body.step
        _differentiate_rate(r, body, over)
        _add_axis(r, weight, _WEIGHT_P[stage], over)
        r = _moved(start, ahead, _rotation_rate(r, tau, body))
        for row in range(7):
            turned = over.turned[row]
            now = over.r[row]
            rate = over.rate[row]
            for col in range(10):
                turned[col] += weight * rate[col]
                now[col] = ahead * rate[col]
            over.r[row, row] += 1.0


@compiled
def _differentiate_rate(r, body, over):
    """Write the derivatives of the rate of (q, w) at a stage."""
    _rotation_jacobian(r, body, over.jacobian)
    for row in range(7):
        m = over.jacobian[row]
        a = m[0]
        b = m[1]
        c = m[2]
        d = m[3]
        e = m[4]
        f = m[5]
        g = m[6]
        for col in range(10):
            over.rate[row, col] = (
                a * over.r[0, col]
                + b * over.r[1, col]
                + c * over.r[2, col]
                + d * over.r[3, col]
                + e * over.r[4, col]
                + f * over.r[5, col]
                + g * over.r[6, col]
            )
    for row in range(3):
        for col in range(3):
            over.rate[4 + row, 7 + col] += body.J_inv[row, col]


@compiled
def _add_axis(r, weight, weight_p, over):
    """Add the thrust axis of a stage, and its derivatives, to their weighted sums."""
    w = r[0]
    i = r[1]
    j = r[2]
    k = r[3]
    D = over.r
    axis = _thrust_axis(r)
    along = ((j, k, w, i), (-i, -w, k, j), (w, -i, -j, k))  # half of d axis / d q
    for row in range(3):
        over.axis_v[row] += weight * axis[row]
        over.axis_p[row] += weight_p * axis[row]
        p, q, s, t = along[row]
        for col in range(10):
            change = 2 * (p * D[0, col] + q * D[1, col] + s * D[2, col] + t * D[3, col])
            over.in_v[row, col] += weight * change
            over.in_p[row, col] += weight_p * change


@compiled
def _write_rows(thrust, body, over, Fx, Fu):
    """Write the Jacobians of one step, (13, 19) and (13, 4), from the derivatives of its stages."""
    step = body.step
    mass = body.mass
    sixth = step / 6
    push_v = sixth * thrust / mass
    push_p = step * sixth * thrust / mass
    for row in range(3):
        Fx[row, row] = 1.0
        Fx[row, 7 + row] = step
        Fx[7 + row, 7 + row] = 1.0
        Fx[row, 13 + row] = 0.5 * step * step / mass
        Fx[7 + row, 13 + row] = step / mass
        Fu[row, 0] = step * sixth * over.axis_p[row] / mass
        Fu[7 + row, 0] = sixth * over.axis_v[row] / mass
        _place(Fx[row], Fu[row], over.in_p[row], push_p)
        _place(Fx[7 + row], Fu[7 + row], over.in_v[row], push_v)
        _place(Fx[10 + row], Fu[10 + row], over.turned[4 + row], sixth)
        Fx[10 + row, 10 + row] += 1.0
    for row in range(4):
        _place(Fx[3 + row], Fu[3 + row], over.turned[row], sixth)
        Fx[3 + row, 3 + row] += 1.0


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
def _rotation_jacobian(r, body, out):
    """Write the Jacobian (7, 7) of the rate of r = (q, w)."""
    w, i, j, k, a, b, c = r
    J = body.J
    over_q = ((0.0, -a, -b, -c), (a, 0.0, c, -b), (b, -c, 0.0, a), (c, b, -a, 0.0))
    over_w = ((-i, -j, -k), (w, -k, j), (k, w, -i), (-j, i, w))
    for row in range(4):
        for col in range(4):
            out[row, col] = 0.5 * over_q[row][col]
        for col in range(3):
            out[row, 4 + col] = 0.5 * over_w[row][col]
    hx, hy, hz = times(J, a, b, c)
    momentum = ((0.0, hz, -hy), (-hz, 0.0, hx), (hy, -hx, 0.0))
    for col in range(3):  # J_inv times -(w x J - (J w) x)
        turned = times(
            body.J_inv,
            c * J[1, col] - b * J[2, col] - momentum[0][col],
            a * J[2, col] - c * J[0, col] - momentum[1][col],
            b * J[0, col] - a * J[1, col] - momentum[2][col],
        )
        for row in range(3):
            out[4 + row, 4 + col] = turned[row]
        out[4 + col, 4 + col] -= body.damping[col]
