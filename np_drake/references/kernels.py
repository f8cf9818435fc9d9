"""Compiled loops of the references: Fourier sums, derivatives through a phase, attitude and rate of
a thrust.
"""

import math

from np_drake.compiled import compiled


@compiled
def horner(coefficients, s, out):
    """Write polynomials at given points.

    Args:
        coefficients: (k, m), lowest power first.
        s: (n,) points.
        out: (k, n).
    """
    for row in range(len(coefficients)):
        for i in range(len(s)):
            out[row, i] = _polynomial(coefficients[row], s[i])


@compiled
def _polynomial(coefficients, s):
    """Return a polynomial (m,), lowest power first, at one point."""
    m = len(coefficients)
    total = coefficients[m - 1]
    for power in range(m - 2, -1, -1):
        total = total * s + coefficients[power]
    return total


@compiled
def ramped(polynomials, t, rate, ramp, out):
    """Write a phase that runs at a constant rate after a ramp from rest, and its derivatives by
    time.

    Args:
        polynomials: (5, m) phase and its derivatives on the ramp, both of unit rate and duration,
            lowest power first.
        t: (n,) [s].
        rate: final one [rad/s].
        ramp: its duration [s].
        out: (5, n) to be written.
    """
    for i in range(len(t)):
        s = min(max(t[i] / ramp, 0.0), 1.0)
        out[0, i] = rate * (ramp * _polynomial(polynomials[0], s) + max(t[i] - ramp, 0.0))
        scale = rate
        for row in range(1, 5):
            out[row, i] = scale * _polynomial(polynomials[row], s)
            scale /= ramp


@compiled
def fourier(phase, center, amplitudes, shifts, out):
    """Write the sum of harmonics 1 … H and its four derivatives by phase to out (5, n, 3).

    Args:
        phase: (n,) [rad].
        center: (3,) [m].
        amplitudes: (H, 3) of amplitude cos(h phase + shift).
        shifts: (H, 3) [rad].
        out: (5, n, 3) to be written.
    """
    for i in range(len(phase)):
        for axis in range(3):
            p, v, a, j, s = center[axis], 0.0, 0.0, 0.0, 0.0
            for row in range(len(amplitudes)):
                h, size = row + 1.0, amplitudes[row, axis]
                if size != 0.0:
                    angle = h * phase[i] + shifts[row, axis]
                    cosine, sine = size * math.cos(angle), size * math.sin(angle)
                    p, v, a = p + cosine, v - h * sine, a - h * h * cosine
                    j, s = j + h * h * h * sine, s + h * h * h * h * cosine
            out[0, i, axis], out[1, i, axis], out[2, i, axis] = p, v, a
            out[3, i, axis], out[4, i, axis] = j, s


@compiled
def compose(path, phase, out):
    """Write the time derivatives of path(phase(t)).

    Source: Faà di Bruno's formula up to the fourth derivative.

    Args:
        path: (5, n, 3) derivatives by phase.
        phase: (5, n) derivatives by time.
        out: (5, n, 3).
    """
    for i in range(path.shape[1]):
        d1, d2, d3, d4 = phase[1, i], phase[2, i], phase[3, i], phase[4, i]
        for axis in range(3):
            a, b, c, d = path[1, i, axis], path[2, i, axis], path[3, i, axis], path[4, i, axis]
            out[0, i, axis] = path[0, i, axis]
            out[1, i, axis] = a * d1
            out[2, i, axis] = b * d1 * d1 + a * d2
            out[3, i, axis] = c * d1 * d1 * d1 + 3 * b * d1 * d2 + a * d3
            out[4, i, axis] = (
                d * d1 * d1 * d1 * d1
                + 6 * c * d1 * d1 * d2
                + b * (3 * d2 * d2 + 4 * d1 * d3)
                + a * d4
            )


@compiled
def _attitude_and_rate(f_x, f_y, f_z, r_x, r_y, r_z):
    """Return quaternion and body rate [rad/s] of a thrust f in W and its rate r, component by
    component.

    The attitude is the shortest tilt to the thrust, so that q_z = 0.
    """
    size = max(math.sqrt(f_x * f_x + f_y * f_y + f_z * f_z), 1e-6)
    x, y, z = f_x / size, f_y / size, f_z / size
    along = x * r_x + y * r_y + z * r_z
    x_1, y_1, z_1 = (r_x - x * along) / size, (r_y - y * along) / size, (r_z - z * along) / size
    w = math.sqrt(max(0.5 * (1 + z), 1e-12))
    i, j = -y / (2 * w), x / (2 * w)
    w_1 = z_1 / (4 * w)
    i_1 = -y_1 / (2 * w) + y * w_1 / (2 * w * w)
    j_1 = x_1 / (2 * w) - x * w_1 / (2 * w * w)
    # Body rate from w = 2 q^* dq/dt
    return w, i, j, 0.0, 2 * (w * i_1 - i * w_1), 2 * (w * j_1 - j * w_1), 2 * (j * i_1 - i * j_1)


@compiled
def follow(flat, chi, mass, gravity, J, delta, x, u):
    """Write the states x (n, 13) and inputs u (n, 4) that follow flat (5, n, 3) under chi (n, 6),
    see `flatness`.

    Args:
        flat: (5, n, 3) motion and its derivatives by time.
        chi: (n, 6) wrench [N, N·m].
        mass: [kg].
        gravity: [m/s²].
        J: (3, 3) inertia [kg·m²].
        delta: step of the central difference that turns body rate into angular acceleration [s].
        x: (n, 13) to be written.
        u: (n, 4) as well.
    """
    for i in range(flat.shape[1]):
        # Thrust m (a + g z) - f_e and its rate; the angular acceleration is a central difference of
        # the body rate
        f_x, f_y = mass * flat[2, i, 0] - chi[i, 0], mass * flat[2, i, 1] - chi[i, 1]
        f_z = mass * (flat[2, i, 2] + gravity) - chi[i, 2]
        j_x, j_y, j_z = mass * flat[3, i, 0], mass * flat[3, i, 1], mass * flat[3, i, 2]
        d_x, d_y, d_z = delta * j_x, delta * j_y, delta * j_z
        s_x, s_y, s_z = (
            delta * mass * flat[4, i, 0],
            delta * mass * flat[4, i, 1],
            delta * mass * flat[4, i, 2],
        )
        w, q_x, q_y, q_z, a, b, c = _attitude_and_rate(f_x, f_y, f_z, j_x, j_y, j_z)
        later = _attitude_and_rate(f_x + d_x, f_y + d_y, f_z + d_z, j_x + s_x, j_y + s_y, j_z + s_z)
        sooner = _attitude_and_rate(
            f_x - d_x, f_y - d_y, f_z - d_z, j_x - s_x, j_y - s_y, j_z - s_z
        )
        for axis in range(3):
            x[i, axis], x[i, 7 + axis] = flat[0, i, axis], flat[1, i, axis]
        x[i, 3], x[i, 4], x[i, 5], x[i, 6] = w, q_x, q_y, q_z
        x[i, 10], x[i, 11], x[i, 12] = a, b, c
        u[i, 0] = math.sqrt(f_x * f_x + f_y * f_y + f_z * f_z)
        h_x = J[0, 0] * a + J[0, 1] * b + J[0, 2] * c
        h_y = J[1, 0] * a + J[1, 1] * b + J[1, 2] * c
        h_z = J[2, 0] * a + J[2, 1] * b + J[2, 2] * c
        u[i, 1], u[i, 2], u[i, 3] = b * h_z - c * h_y, c * h_x - a * h_z, a * h_y - b * h_x
        for row in range(3):
            turn = 0.0
            for axis in range(3):
                turn += J[row, axis] * (later[4 + axis] - sooner[4 + axis])
            u[i, 1 + row] += turn / (2 * delta) - chi[i, 3 + row]


@compiled
def rates(flat, gravity, w):
    """Write the body rates that follow a motion without any wrench.

    Args:
        flat: (5, n, 3).
        gravity: [m/s²].
        w: (n, 3) is written [rad/s].
    """
    for i in range(flat.shape[1]):
        found = _attitude_and_rate(
            flat[2, i, 0],
            flat[2, i, 1],
            flat[2, i, 2] + gravity,
            flat[3, i, 0],
            flat[3, i, 1],
            flat[3, i, 2],
        )
        w[i, 0], w[i, 1], w[i, 2] = found[4], found[5], found[6]
