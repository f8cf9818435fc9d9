"""A family of lifted linear systems with a network on top of its encoder.

    theta' = theta + dtheta(w, theta),   z = E(theta') w + dz(w, theta),   A = A(theta'),   B = B(theta')

A large swing thus gets its lower frequency. theta itself is estimated as without network. A stays stable, as it is for
every theta, and with a share of 0 all forecasts are those of the family.
Source: own choice.
"""

import dataclasses as dc
from typing import Any

import numpy as np

from np_drake.lifting.model.adaptive_family import AdaptiveFamily, family_of, family_tensors
from np_drake.lifting.model.window_network import WindowNetwork


@dc.dataclass(frozen=True)
class NeuralFamily(AdaptiveFamily):
    """Family whose theta and z a network corrects at every sample."""

    network: WindowNetwork

    def __post_init__(self):
        super().__post_init__()
        states = tuple((len(axis.channels), axis.K) for axis in self.axes)
        windows = [axis.encoder.shape[1] for axis in self.axes]
        if self.network.states != states or [w.shape[1] for w in self.network.white] != windows:
            raise ValueError("NeuralFamily: the network must see the family's windows, and correct its z.")
        if len(self.network.center) != len(self.mean):
            raise ValueError(f"NeuralFamily: the network must have the {len(self.mean)} entries of theta.")

    @property
    def plain(self) -> AdaptiveFamily:
        """Family without the network."""
        return AdaptiveFamily(**_fields(self))

    def read(self, window: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return theta (..., r) at which windows are forecast, and z (..., K), see `AdaptiveFamily.read`.

        Args:
            window: (..., W, 12), oldest first, W >= D [N, N·m, m/s, rad/s].
            theta: (..., r) as estimated.
        """
        seen = self.seen(window[..., window.shape[-2] - self.delay :, :])
        dz, change = self.network.correction(self.network.inputs(seen, theta))
        theta = theta + change
        at = np.concatenate([np.ones_like(theta[..., :1]), theta], axis=-1)[..., None, None, :]
        z = [
            np.sum((s @ axis.by_theta).reshape(*s.shape[:-1], axis.K, -1) * at, axis=-1)
            for s, axis in zip(seen, self.axes, strict=True)
        ]
        return theta, dz + np.concatenate([part.reshape(*part.shape[:-2], -1) for part in z], axis=-1)

    def along(self, samples: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A (o, K, K), B (o, K, 6) and z (o, K) at every sample, see `AdaptiveFamily.along`.

        Args:
            samples: (n, 12) of a flight without gaps, n >= D [N, N·m, m/s, rad/s].
            step: [s].
        """
        windows = np.lib.stride_tricks.sliding_window_view(samples, self.delay, axis=0).swapaxes(1, 2)
        thetas, z = self.read(windows, self.thetas(samples, step))
        systems = [self.system(theta, step) for theta in thetas]
        return np.stack([s.A for s in systems]), np.stack([s.B for s in systems]), z


def neural_tensors(family: NeuralFamily) -> dict[str, np.ndarray]:
    """Return the arrays of a family and its network by name, as a model file holds them."""
    n = family.network
    tensors = {f"network/{name}": getattr(n, name) for name in ("center", "spread", "size")}
    tensors["network/share"] = np.array([n.share])
    for name, arrays in (("white", n.white), ("weights", n.weights), ("biases", n.biases)):
        tensors |= {f"network/{name}{i}": array for i, array in enumerate(arrays)}
    return family_tensors(family) | tensors


def neural_family_of(tensors: dict[str, np.ndarray]) -> NeuralFamily:
    """Return the family with its network in the tensors of a model file.

    Raises: KeyError, ValueError: where they hold none.
    """
    family = family_of(tensors)

    def listed(name: str) -> tuple[np.ndarray, ...]:
        count = sum(key.startswith(f"network/{name}") for key in tensors)
        return tuple(tensors[f"network/{name}{i}"] for i in range(count))

    center, spread, size, share = (tensors[f"network/{name}"] for name in ("center", "spread", "size", "share"))
    states = tuple((len(axis.channels), axis.K) for axis in family.axes)
    network = WindowNetwork(
        listed("white"), states, listed("weights"), listed("biases"), center, spread, size, float(share[0])
    )
    return with_network(family, network)


def with_network(family: AdaptiveFamily, network: WindowNetwork) -> NeuralFamily:
    """Return a family, with or without network, with this one.

    Args:
        family: whose window the network sees.
        network: that corrects its theta and z.
    """
    return NeuralFamily(**_fields(family), network=network)


def _fields(family: AdaptiveFamily) -> dict[str, Any]:
    return {field.name: getattr(family, field.name) for field in dc.fields(AdaptiveFamily)}
