"""A perceptron of the motion, in numpy, as used in flight."""

import dataclasses as dc

import numpy as np


@dc.dataclass(frozen=True)
class WrenchNetwork:
    """Perceptron chi = unit (W^(L+1) relu(W^L … relu(W^1 zeta / scale + b^1) …) + b^(L+1)).

    Unlike the layers of Phi, these have biases: a payload pulls on the vehicle at rest too. At a
    kink of a ReLU the Jacobian is that of the inactive side.
    """

    weights: tuple[np.ndarray, ...]  # (out, in)
    biases: tuple[np.ndarray, ...]  # (out,)
    scale: np.ndarray  # (6,) of zeta [m/s, rad/s]
    unit: np.ndarray  # (6,) of chi [N, N·m]

    def __post_init__(self):
        width = 6
        for W, b in zip(self.weights, self.biases, strict=True):
            if W.ndim != 2 or W.shape[1] != width or b.shape != (len(W),):
                raise ValueError(
                    f"WrenchNetwork: each layer must take the {width} outputs before it; "
                    f"got {W.shape}."
                )
            width = len(W)
        if not self.weights or width != 6 or self.scale.shape != (6,) or self.unit.shape != (6,):
            raise ValueError("WrenchNetwork: the last layer, scale and unit must have six entries.")

    def __call__(self, zeta: np.ndarray) -> np.ndarray:
        """Return chi (..., 6) [N, N·m] at zeta (..., 6) [m/s, rad/s]."""
        value = zeta / self.scale
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            value = np.maximum(value @ W.T + b, 0.0)
        return (value @ self.weights[-1].T + self.biases[-1]) * self.unit

    def jacobian(self, zeta: np.ndarray) -> np.ndarray:
        """Return dchi/dzeta (n, 6, 6) at zeta (n, 6)."""
        value = zeta / self.scale
        slope = np.broadcast_to(np.diag(1.0 / self.scale), (*value.shape, 6))
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            before = value @ W.T + b
            value, slope = np.maximum(before, 0.0), (before > 0)[..., None] * (W @ slope)
        return self.unit[:, None] * (self.weights[-1] @ slope)

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        layers = {f"W{i}": W for i, W in enumerate(self.weights)} | {
            f"b{i}": b for i, b in enumerate(self.biases)
        }
        return layers | {"scale": self.scale, "unit": self.unit}

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "WrenchNetwork":
        """Return the network of the arrays in a model file.

        Raises: KeyError, ValueError: on missing or inconsistent arrays.
        """
        depth = range(sum(name.startswith("W") for name in tensors))
        weights, biases = (tuple(tensors[f"{letter}{i}"] for i in depth) for letter in "Wb")
        return cls(weights, biases, tensors["scale"], tensors["unit"])
