"""Model files of any kind: safetensors with all numbers of the model in the header, the conditions
of its training, and whether a controller may use it. Nothing pickled is ever read.
"""

import dataclasses as dc
import json
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from np_drake.checks import require
from np_drake.files.file_access import parse_json, write_bytes
from np_drake.labels import LabelConfig
from np_drake.vehicle import Vehicle


class Trained(Protocol):
    """A dataclass with a `summary` of its training."""

    @property
    def summary(self) -> dict[str, Any]:
        """Key figures and conditions of the training."""


M = TypeVar("M", bound=Trained)


def origin_of(frame: str, vehicle: Vehicle, label: LabelConfig) -> dict[str, Any]:
    """Return the conditions of a training by name.

    Args:
        vehicle: whose mass the labels assume [kg].
    """
    return {"frame": frame, "mass": vehicle.mass, "label": dc.asdict(label)}


def with_origin(model: M, origin: dict[str, Any], **more: Any) -> M:
    """Return the model with the `origin` of `origin_of` and more in its summary, and so in its
    file; `rotor_lag`, the time constant of its vehicle's rotors [s], filters the command in flight.
    """
    return dc.replace(model, summary={**model.summary, "origin": origin, **more})  # type: ignore[type-var]


def rotor_lag_of(model: Trained) -> float:
    """Return the rotor lag stored with the model [s]; 0 where there is none."""
    return float(model.summary.get("rotor_lag", 0.0))


def label_of(model: Trained) -> LabelConfig:
    """Return the low-pass of the labels that the model was trained on; the default where it is
    unknown.
    """
    return LabelConfig(**model.summary.get("origin", {}).get("label", {}))


def delay_of(model: Trained) -> float | None:
    """Return the delay of commands that the training found [s]; None where it sought none."""
    return model.summary.get("command_delay")


def require_origin(model: Trained, origin: dict[str, Any]) -> None:
    """Check that the model was trained on labels like those that it will be fed.

    An origin that is unknown passes.

    Args:
        origin: of what it will be fed, or a part of it.
    Raises: ValueError: if an item of the origin differs.
    """
    trained = model.summary.get("origin", {})
    for name, value in origin.items():
        if name in trained and trained[name] != value:
            raise ValueError(
                f"predictor: was trained with {name} {trained[name]}; here it is {value}. "
                f"Train it on such labels."
            )


# What a header may hold, own choice: beyond it a file is damaged.
STEPS = (1e-4, 10.0)  # shortest and longest step [s]


def summary_in(header: dict[str, Any]) -> dict[str, Any]:
    """Return the summary of a header.

    Raises: ValueError: if a part of it that a flight depends on is not what it must be; KeyError:
    if there is none.
    """
    summary = dict(header["summary"])
    origin = summary.get("origin", {})
    require(
        isinstance(origin, dict), f"summary.origin must be names with their values; got {origin!r}."
    )
    lag = summary.get("rotor_lag", 0.0)
    require(
        isinstance(lag, int | float) and 0 <= lag < 10,
        f"summary.rotor_lag must be 0 to 10 s; got {lag!r}.",
    )
    LabelConfig(**origin.get("label", {})).check()
    if "command_delay" in summary:
        number_in(summary, "command_delay", 0.0, STEPS[1])
    return summary


def number_in(header: dict[str, Any], name: str, lowest: float, largest: float) -> float:
    """Return a number of a header.
    Raises: ValueError: if it is none, or outside these bounds; KeyError: if the header lacks it.
    """
    value = header[name]
    require(
        not isinstance(value, bool)
        and isinstance(value, int | float)
        and lowest <= value <= largest,
        f"{name} must be a number from {lowest:g} to {largest:g}; got {value!r}.",
    )
    return float(value)


Array = Any  # of numpy in flight, a tensor of torch in training


@dc.dataclass(frozen=True)
class Perceptron:
    """Layers y = W^(L+1) relu(W^L … relu(W^1 x + b^1) …) + b^(L+1), of either kind of arrays."""

    weights: tuple[Array, ...]  # (out, in)
    biases: tuple[Array, ...]  # (out,)

    def require_sizes(self, inputs: int, outputs: int) -> None:
        """Raises: ValueError: unless each layer takes what the one before it gives."""
        width = inputs
        for W, b in zip(self.weights, self.biases, strict=True):
            require(
                W.ndim == 2 and W.shape[1] == width and b.shape == (len(W),),
                f"Perceptron: each layer must take the {width} outputs before it; got {W.shape}.",
            )
            width = len(W)
        require(
            self.weights and width == outputs,
            f"Perceptron: the last layer must have {outputs} outputs; got {width}.",
        )

    def __call__(self, value: Array) -> Array:
        """Return y (..., out) of x (..., in)."""
        for W, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            value = (value @ W.T + b).clip(0.0)
        return value @ self.weights[-1].T + self.biases[-1]

    def in_numpy(self) -> "Perceptron":
        """Return it with arrays in the place of tensors."""
        layers: dict[str, Any] = {
            name: tuple(np.asarray(part.detach(), float) for part in parts)
            for name, parts in vars(self).items()
        }
        return Perceptron(**layers)

    def tensors(self) -> dict[str, np.ndarray]:
        """Return the arrays that a model file holds, by name."""
        return {
            f"{letter}{i}": part
            for letter, parts in (("W", self.weights), ("b", self.biases))
            for i, part in enumerate(parts)
        }

    @classmethod
    def taken_from(cls, tensors: dict[str, np.ndarray]) -> "Perceptron":
        """Return the layers of the arrays in a model file, and remove them there.

        Raises: KeyError: on missing arrays.
        """
        depth = range(sum(name.startswith("W") for name in tensors))
        return cls(*(tuple(tensors.pop(f"{letter}{i}") for i in depth) for letter in "Wb"))


# What building a model of damaged content raises.
_DAMAGED = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError)


def write_model(
    tensors: dict[str, np.ndarray], schema: str, header: dict[str, Any], path: str | Path
) -> None:
    """Write a model file of any kind, whole or not at all; equal content gives equal bytes.

    Args:
        header: all else that makes the model, `summary` among it.
    Raises: OSError: if it cannot be written.
    """
    metadata = {"schema": schema, "model": json.dumps(header)}
    content = save({name: np.ascontiguousarray(value) for name, value in tensors.items()}, metadata)
    write_bytes(path, _with_sorted_header(content))


def _with_sorted_header(content: bytes) -> bytes:
    """Return the content of a safetensors file with the names of its header in order.

    The library writes the metadata in an order that changes from process to process, and cases name
    a model by the digest of its file.
    """
    start = 8 + int.from_bytes(content[:8], "little")
    header = json.dumps(
        json.loads(content[8:start]), sort_keys=True, separators=(",", ":")
    ).encode()
    header = header.ljust(-(-len(header) // 8) * 8)  # tensors begin at a multiple of 8 bytes
    return len(header).to_bytes(8, "little") + header + content[start:]


def schema_of(path: str | Path) -> str:
    """Return the schema named in a safetensors file; empty where it names none or is no such
    file.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            return str((file.metadata() or {}).get("schema", ""))
    except (SafetensorError, OSError, ValueError, TypeError):
        return ""


def read_tensors(path: str | Path, schema: str) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return (tensors, metadata) of a safetensors file of the given schema.
    Raises: ValueError: one line, if the file is missing or broken, has another schema or holds
        non-finite numbers.
    """
    try:
        with safe_open(str(path), framework="numpy") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path}: not a model file: {_reason(path, error)}") from error
    require(
        metadata.get("schema") == schema,
        f"{path}: schema must be {schema}; got {metadata.get('schema', 'none')}. Train again: "
        "another version or configuration made it.",
    )
    for name, value in tensors.items():
        require(
            value.dtype.kind == "f" and np.all(np.isfinite(value)),
            f"{path}: tensor {name} must hold finite floating-point numbers.",
        )
    return tensors, metadata


def read_model(
    path: str | Path, schema: str, build: Callable[[dict[str, np.ndarray], dict[str, Any]], M]
) -> M:
    """Return the model in a file of any kind.
    Raises: ValueError: one line, if the file is missing, truncated, pickled, of another format or
        inconsistent.
    """
    tensors, metadata = read_tensors(path, schema)
    try:
        return build(tensors, parse_json(metadata["model"]))
    except _DAMAGED as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        what = f"lacks {error}; train it again" if isinstance(error, KeyError) else reason
        raise ValueError(f"{path}: not a usable model file: {what}") from error


class ModelFile(ABC):
    """A trained model that a file can hold, under a schema of its own."""

    schema: ClassVar[str]  # format of the file and its version

    @abstractmethod
    def content(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return the arrays that make the model, and the header: all else, `summary` among it."""

    @classmethod
    @abstractmethod
    def of_content(cls, tensors: dict[str, np.ndarray], header: dict[str, Any]) -> Self:
        """Return the model of the content of a file.

        Raises: KeyError, ValueError: on missing or inconsistent content.
        """

    def save(self, path: str | Path) -> None:
        """Write the model file, whole or not at all.

        Raises: OSError: if it cannot be written.
        """
        tensors, header = self.content()
        write_model(tensors, self.schema, header, path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the model in a file.

        Raises: ValueError: as `read_model`.
        """
        return read_model(path, cls.schema, cls.of_content)  # type: ignore[type-var]


def _reason(path: str | Path, error: Exception) -> str:
    """Return why a file is no safetensors file, in words."""
    try:
        with open(path, "rb") as file:
            start = file.read(4)
    except OSError as failure:
        return f"{failure.strerror or failure}."
    if start[:2] == b"PK" or start[:1] == b"\x80":
        return (
            "this is a pickle (.pt, .pkl), which is never loaded. Save it with `np-drake "
            "train --out`."
        )
    return f"truncated or another format ({str(error).splitlines()[0]})."
