"""Quaternions (w, x, y, z; body to world) and rotation matrices, vectorised over leading axes."""

import numpy as np


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """(..., 4) unit quaternion -> (..., 3, 3) R_WB."""
    w, x, y, z = np.moveaxis(np.asarray(q, float), -1, 0)
    R = np.empty((*w.shape, 3, 3))
    R[..., 0, 0] = 1 - 2 * (y * y + z * z)
    R[..., 0, 1] = 2 * (x * y - w * z)
    R[..., 0, 2] = 2 * (x * z + w * y)
    R[..., 1, 0] = 2 * (x * y + w * z)
    R[..., 1, 1] = 1 - 2 * (x * x + z * z)
    R[..., 1, 2] = 2 * (y * z - w * x)
    R[..., 2, 0] = 2 * (x * z - w * y)
    R[..., 2, 1] = 2 * (y * z + w * x)
    R[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return R


def body_z(q: np.ndarray) -> np.ndarray:
    """(..., 4) quaternion -> (..., 3) body z axis in W. Quadratic in q; no normalisation."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), w * w - x * x - y * y + z * z], axis=-1)


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(..., 4) Hamilton product p q."""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def quaternion_rate(q: np.ndarray, w_WB_B: np.ndarray) -> np.ndarray:
    """(..., 4) dq/dt = q * [0, w] / 2 [1/s]."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    a, b, c = np.moveaxis(w_WB_B, -1, 0)
    return 0.5 * np.stack(
        [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a], axis=-1
    )


def rotate(q: np.ndarray, r_B: np.ndarray) -> np.ndarray:
    """(..., 3) a body vector in W."""
    return np.einsum("...ij,...j->...i", rotation_matrix(q), r_B)


def rotate_back(q: np.ndarray, r_W: np.ndarray) -> np.ndarray:
    """(..., 3) a world vector in B."""
    return np.einsum("...ji,...j->...i", rotation_matrix(q), r_W)


def same_hemisphere(q: np.ndarray, q_near: np.ndarray) -> np.ndarray:
    """(..., 4) q or -q, whichever lies nearer to `q_near`."""
    sign = np.where(np.sum(q * q_near, axis=-1, keepdims=True) < 0, -1.0, 1.0)
    return sign * q


def quaternion_from_axes(z_B_W: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """(..., 4) attitude with body z along the unit vector `z_B_W` (..., 3) and heading `yaw` [rad].

    The shortest tilt from world z to `z_B_W` after a turn by `yaw`; singular only upside down.
    """
    zx, zy, zz = np.moveaxis(np.asarray(z_B_W, float), -1, 0)
    w = np.sqrt(np.maximum(0.5 * (1 + zz), 1e-12))
    tilt = np.stack([w, -zy / (2 * w), zx / (2 * w), np.zeros_like(w)], axis=-1)
    half = 0.5 * np.broadcast_to(np.asarray(yaw, float), w.shape)
    turn = np.stack([np.cos(half), np.zeros_like(w), np.zeros_like(w), np.sin(half)], axis=-1)
    return multiply(tilt, turn)
