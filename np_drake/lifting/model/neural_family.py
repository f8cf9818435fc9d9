"""A family of lifted linear systems with a network on top of its encoder.

    theta' = theta + dtheta(w, theta),
    z = E(theta') w + dz(w, theta),
    A = A(theta'),
    B = B(theta')

A large swing thus gets its lower frequency. theta itself is estimated as without network. A stays
stable, as it is for every theta, and with a share of 0 all forecasts are those of the family.
Source: own choice.
"""

import dataclasses as dc
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy

from np_drake.checks import require
from np_drake.lifting.model.adaptive_family import AdaptiveFamily, family_fields

# that an input counts for, own choice: beyond four deviations it is unlike the training's [1]
MOST = 4.0
STEEPEST = 1.1  # slope of silu is at most 1.0998 [1]
T = TypeVar("T")


@dc.dataclass(frozen=True)
class WindowNetwork:
    """Network of the windows that axes see, each with one view (z) or two (x and y), and of theta
    (r,).

    white: (n, D c) of each axis, maps a view's window to its principal components.
    states: (views, states a view) of each axis.
    weights: (out, in) of each layer, the last one's outputs z (K,) and theta (r,).
    biases: (out,). center, spread: (r,) of theta in training.
    size: (K,) of z in training.
    share: of the correction, 0 to 1 [1].
    """

    white: tuple[np.ndarray, ...]
    states: tuple[tuple[int, int], ...]
    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    center: np.ndarray
    spread: np.ndarray
    size: np.ndarray
    share: float

    def __post_init__(self):
        r, K = len(self.center), sum(views * states for views, states in self.states)
        require(
            all(views in (1, 2) for views, _ in self.states),
            "WindowNetwork: an axis must have one view (z) or two (x and y).",
        )
        inputs = (
            sum(
                views * len(white)
                for (views, _), white in zip(self.states, self.white, strict=True)
            )
            + r
        )
        for W, b in zip(self.weights, self.biases, strict=True):
            require(
                W.ndim == 2 and W.shape[1] == inputs and b.shape == (len(W),),
                f"WindowNetwork: a layer must take the {inputs} outputs before it; got {W.shape}.",
            )
            inputs = len(W)
        require(
            inputs == K + r
            and len(self.weights) >= 2
            and self.spread.shape == (r,)
            and self.size.shape == (K,),
            f"WindowNetwork: outputs must be z and theta, {K} and {r} numbers; got {inputs}.",
        )
        require(
            0 <= self.share <= 1 and np.all(self.spread > 0) and np.all(self.size > 0),
            "WindowNetwork: share must be 0 to 1, spread and size positive.",
        )

    @property
    def lipschitz_bound(self) -> float:
        """Bound of its slope in the scaled inputs and outputs; that of silu is at most `STEEPEST`
        [1].
        """
        return float(
            STEEPEST ** (len(self.weights) - 1)
            * np.prod([np.linalg.norm(W, 2) for W in self.weights])
        )

    def inputs(self, seen: list[np.ndarray], theta: np.ndarray) -> np.ndarray:
        """Return s(x) (..., n).

        Args:
            seen: (..., V, D c) windows of each axis as its views see them, scaled.
            theta: (r,) or (..., r) of the family now.
        """
        parts = [s @ white.T for s, white in zip(seen, self.white, strict=True)]
        views = [part.reshape(*part.shape[:-2], -1) for part in parts]
        at = np.broadcast_to(
            (theta - self.center) / self.spread, (*views[0].shape[:-1], len(self.center))
        )
        return saturated(np.concatenate([*views, at], axis=-1))

    def correction(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return dz (..., K) and dtheta (..., r) of `inputs` (..., n)."""
        first, last, offset = self._images
        h = _silu((x @ first).reshape(*x.shape[:-1], -1, len(self.biases[0])) + self.biases[0])
        for W, b in zip(self.weights[1:-1], self.biases[1:-1], strict=True):
            h = _silu(h @ W.T + b)
        out = self.share * (h.reshape(*x.shape[:-1], -1) @ last + offset)
        K = len(self.size)
        return out[..., :K] * self.size, out[..., K:] * self.spread

    @cached_property
    def _images(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """First and last layer of all images side by side, and the last bias's mean over them."""
        r = len(self.center)
        before = images(
            [
                (views, len(white))
                for (views, _), white in zip(self.states, self.white, strict=True)
            ],
            r,
        )
        after = images(list(self.states), r)
        first = np.concatenate([(self.weights[0] @ T).T for T in before], axis=1)
        last = np.concatenate([self.weights[-1].T @ T for T in after]) / len(after)
        return first, last, np.mean([T.T @ self.biases[-1] for T in after], axis=0)


def saturated(x: T) -> T:
    """Return inputs s(x), an array or a tensor."""
    return x / (1.0 + (x / MOST) ** 2) ** 0.5  # type: ignore[operator]


def _silu(x: np.ndarray) -> np.ndarray:
    return x * scipy.special.expit(x)


def images(axes: list[tuple[int, int]], rest: int) -> np.ndarray:
    """Return the eight turns and mirror images of what axes hold, (8, n, n), each orthogonal.

    A quarter turn takes the view along x to that along y, and this to the first one's negative.

    Args:
        axes: (views, numbers a view) of each axis, which stand side by side.
    """
    quarter, mirror = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.diag([1.0, -1.0])
    turns = [np.linalg.matrix_power(quarter, i) for i in range(4)]
    return np.stack(
        [
            scipy.linalg.block_diag(
                *(np.kron(T if views == 2 else np.eye(1), np.eye(n)) for views, n in axes),
                np.eye(rest),
            )
            for T in [*turns, *(turn @ mirror for turn in turns)]
        ]
    )


@dc.dataclass(frozen=True)
class NeuralFamily(AdaptiveFamily):
    """Family whose theta and z a network corrects at every sample."""

    network: WindowNetwork

    def __post_init__(self):
        super().__post_init__()
        states = tuple((len(axis.channels), axis.K) for axis in self.axes)
        windows = [axis.encoder.shape[1] for axis in self.axes]
        require(
            self.network.states == states and [w.shape[1] for w in self.network.white] == windows,
            "NeuralFamily: the network must see the family's windows, and correct its z.",
        )
        require(
            len(self.network.center) == len(self.mean),
            f"NeuralFamily: the network must have the {len(self.mean)} entries of theta.",
        )

    @property
    def plain(self) -> AdaptiveFamily:
        """Family without the network."""
        return AdaptiveFamily(**_fields(self))

    def corrected(self, seen: list[np.ndarray], theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return theta (..., r) and what is added to z (..., K), see `AdaptiveFamily.corrected`.

        Args:
            seen: windows as of `seen`.
            theta: (r,) or (..., r) as estimated.
        """
        dz, change = self.network.correction(self.network.inputs(seen, theta))
        return theta + change, dz

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays of family and network that a model file holds, by name."""
        n = self.network
        tensors = {f"network/{name}": getattr(n, name) for name in ("center", "spread", "size")}
        tensors["network/share"] = np.array([n.share])
        for name in ("white", "weights", "biases"):
            tensors |= {f"network/{name}{i}": array for i, array in enumerate(getattr(n, name))}
        return super().tensors() | tensors

    @classmethod
    def from_tensors(cls, tensors: dict[str, np.ndarray]) -> "NeuralFamily":
        """Return the family with its network in the tensors of a model file.

        Raises: KeyError, ValueError: where they hold none.
        """
        fields = family_fields(tensors)
        states = tuple((len(axis.channels), axis.K) for axis in fields["axes"])
        parts: dict[str, Any] = {}
        for name in ("white", "weights", "biases"):
            count = sum(key.startswith(f"network/{name}") for key in tensors)
            parts[name] = tuple(tensors[f"network/{name}{i}"] for i in range(count))
        parts |= {name: tensors[f"network/{name}"] for name in ("center", "spread", "size")}
        share = float(tensors["network/share"][0])
        network = WindowNetwork(states=states, **parts, share=share)
        return cls(**fields, network=network)


def with_network(family: AdaptiveFamily, network: WindowNetwork) -> NeuralFamily:
    """Return a family, with or without network, with this one."""
    return NeuralFamily(**_fields(family), network=network)


def _fields(family: AdaptiveFamily) -> dict[str, Any]:
    return {field.name: getattr(family, field.name) for field in dc.fields(AdaptiveFamily)}
