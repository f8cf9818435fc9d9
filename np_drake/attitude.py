"""Quaternions (w, x, y, z; body to world) and rotation matrices, vectorised over leading axes."""

import numpy as np


def _components(r: np.ndarray) -> tuple | list:
    """Unpack the last axis; a single vector gives plain floats, which are ten times as fast."""
    r = np.asarray(r)
    return r.tolist() if r.ndim == 1 else tuple(r[..., i] for i in range(r.shape[-1]))


def _vector(*components) -> np.ndarray:
    """Stack components on the last axis, the inverse of `_components`."""
    if isinstance(components[0], float):
        return np.array(components)
    shape = (*np.shape(components[0]), len(components))
    out = np.empty(shape, np.result_type(components[0], float))  # or object: symbols of CasADi
    for i, component in enumerate(components):
        out[..., i] = component
    return out


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Return R_WB (..., 3, 3) of unit quaternions (..., 4)."""
    R = _vector(*_entries(*_components(q)))
    return R.reshape(*R.shape[:-1], 3, 3)


def _entries(w, x, y, z) -> tuple:
    """Return the nine entries of R_WB, row by row."""
    return (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )


def body_z(q: np.ndarray) -> np.ndarray:
    """Return the body z axis in W (..., 3) of quaternions (..., 4), quadratic in q and without
    normalisation.
    """
    w, x, y, z = _components(q)
    return _vector(2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z)


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the Hamilton product p q, (..., 4).

    Args:
        p: (..., 4) quaternion that turns last.
        q: (..., 4) the one that turns first.
    """
    pw, px, py, pz = _components(p)
    qw, qx, qy, qz = _components(q)
    return _vector(
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def quaternion_rate(q: np.ndarray, w_WB_B: np.ndarray) -> np.ndarray:
    """Return dq/dt = q * [0, w] / 2, (..., 4) [1/s].

    Args:
        q: (..., 4) attitude.
        w_WB_B: (..., 3) body rates [rad/s].
    """
    w, x, y, z = _components(q)
    a, b, c = _components(w_WB_B)
    return 0.5 * _vector(
        -x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a
    )


def skew(r: np.ndarray) -> np.ndarray:
    """Return the matrices (..., 3, 3) with skew(r) @ s = r x s, for vectors r (..., 3)."""
    x, y, z = _components(r)
    o = 0.0 * x
    S = _vector(o, -z, y, z, o, -x, -y, x, o)
    return S.reshape(*S.shape[:-1], 3, 3)


def rotate(q: np.ndarray, r_B: np.ndarray) -> np.ndarray:
    """Return a body vector in W, (..., 3).

    Args:
        q: (..., 4) attitude.
        r_B: (..., 3) vector in B.
    """
    return (rotation_matrix(q) @ r_B[..., None])[..., 0]


def rotate_back(q: np.ndarray, r_W: np.ndarray) -> np.ndarray:
    """Return a world vector in B, (..., 3).

    Args:
        q: (..., 4) attitude.
        r_W: (..., 3) vector in W.
    """
    if r_W.ndim == 1 and np.ndim(q) == 1:
        a, b, c, d, e, f, g, h, i = _entries(*np.asarray(q, float).tolist())
        x, y, z = r_W.tolist()
        return np.array((x * a + y * d + z * g, x * b + y * e + z * h, x * c + y * f + z * i))
    return (r_W[..., None, :] @ rotation_matrix(q))[..., 0, :]


def one_hemisphere(q: np.ndarray, q_near: np.ndarray) -> np.ndarray:
    """Flip signs so that each quaternion lies near its predecessor; q and -q are one attitude.

    Args:
        q: (n, 4) sequence.
        q_near: (4,) before the first.
    """
    chain = np.vstack([q_near, q])
    flips = np.where(np.sum(chain[1:] * chain[:-1], axis=1) < 0, -1.0, 1.0)
    return q * np.cumprod(flips)[:, None]


def quaternion_from_axes(z_B_W: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """Return the attitude (..., 4) of a thrust direction and a heading.

    The shortest tilt from world z to `z_B_W` after a turn by `yaw`; singular only upside down.

    Args:
        z_B_W: (..., 3) unit vector of body z in W.
        yaw: (...) heading [rad].
    """
    zx, zy, zz = _components(z_B_W)
    w = np.sqrt(np.maximum(0.5 * (1 + zz), 1e-12))
    tilt = _vector(w, -zy / (2 * w), zx / (2 * w), np.zeros_like(w))
    half = 0.5 * np.broadcast_to(np.asarray(yaw, float), w.shape)
    turn = _vector(np.cos(half), np.zeros_like(w), np.zeros_like(w), np.sin(half))
    return multiply(tilt, turn)


def rotation_vector(q: np.ndarray) -> np.ndarray:
    """Return the rotation vector (..., 3) [rad] of a unit quaternion (..., 4), of at most half a
    turn.
    """
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)


def turn_between(q: np.ndarray, q_other: np.ndarray) -> np.ndarray:
    """Return the rotation vector (..., 3) [rad] that turns q to q_other (..., 4), in its axes."""
    return rotation_vector(multiply(conjugate(q), q_other))


def normalised(q: np.ndarray) -> np.ndarray:
    """Return quaternions (..., 4) at unit length."""
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def from_rotation_vector(r: np.ndarray) -> np.ndarray:
    """Return the unit quaternion (..., 4) of a rotation vector (..., 3) [rad]."""
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    # sin(angle / 2) / angle, without a division by a small angle.
    scale = 0.5 * np.sinc(angle / (2 * np.pi))
    return np.concatenate([np.cos(0.5 * angle), scale * r], axis=-1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """Return the conjugate (..., 4) of a unit quaternion, its inverse rotation."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def integrated(t: np.ndarray, q0: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Integrate body rates to an attitude by trapezoidal rotation vectors.

    Args:
        t: (n,) times [s].
        q0: (4,) initial attitude.
        w: (n, 3) body rates in B [rad/s].
    Returns: (n, 4) attitude.
    """
    turns = from_rotation_vector(0.5 * (w[1:] + w[:-1]) * np.diff(t)[:, None])
    out = np.empty((len(t), 4))
    pw, px, py, pz = (float(v) for v in q0)
    out[0] = q0
    for i, (w0, x, y, z) in enumerate(turns.tolist(), start=1):
        pw, px, py, pz = (
            pw * w0 - px * x - py * y - pz * z,
            pw * x + px * w0 + py * z - pz * y,
            pw * y - px * z + py * w0 + pz * x,
            pw * z + px * y - py * x + pz * w0,
        )
        out[i] = (pw, px, py, pz)
    return normalised(out)
