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
            raise ValueError(
                "NeuralFamily: the network must see the family's windows, and correct its z."
            )
        if len(self.network.center) != len(self.mean):
            raise ValueError(
                f"NeuralFamily: the network must have the {len(self.mean)} entries of theta."
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

    center, spread, size, share = (
        tensors[f"network/{name}"] for name in ("center", "spread", "size", "share")
    )
    states = tuple((len(axis.channels), axis.K) for axis in family.axes)
    network = WindowNetwork(
        listed("white"),
        states,
        listed("weights"),
        listed("biases"),
        center,
        spread,
        size,
        float(share[0]),
    )
    return with_network(family, network)


def with_network(family: AdaptiveFamily, network: WindowNetwork) -> NeuralFamily:
    """Return a family, with or without network, with this one."""
    return NeuralFamily(**_fields(family), network=network)


def _fields(family: AdaptiveFamily) -> dict[str, Any]:
    return {field.name: getattr(family, field.name) for field in dc.fields(AdaptiveFamily)}
