"""A trained predictor: encoder, lifted linear system and trust; and model files: safetensors with
the configuration in the header, the conditions of a training, and whether a controller may use it.
Nothing pickled is ever read.
"""

import dataclasses as dc
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from np_drake.checks import require
from np_drake.files.file_access import parse_json, write_bytes
from np_drake.labels import LabelConfig
from np_drake.lifting.model.adaptive_family import AdaptiveFamily
from np_drake.lifting.model.lifted_linear_system import DelayEncoder, LiftedLinearSystem, Phi, Trust
from np_drake.lifting.model.neural_family import NeuralFamily
from np_drake.vehicle import Vehicle

PAPER, LIFTED, NEURAL, MODE_DICTIONARY = "paper", "lifted", "neural", "mode-dictionary"
ENCODERS: dict[
    str, type[Phi] | type[DelayEncoder] | type[AdaptiveFamily]
] = {  # of each configuration, by name
    LIFTED: AdaptiveFamily,
    NEURAL: NeuralFamily,
    PAPER: Phi,
    MODE_DICTIONARY: DelayEncoder,
}
FAMILIES = (
    LIFTED,
    NEURAL,
)  # configurations of many payloads, of which one's own flights only place theta
BY_AXES = {
    "world": LIFTED,
    "body": MODE_DICTIONARY,
}  # configuration that suits flights in these axes alone


@dc.dataclass(frozen=True)
class LiftedModel:
    """Trained predictor as held by a model file, with all matrices in physical units.

    late: samples by which the labels that Phi sees lag behind the wrench; z is taken to the present
    by the zeta since.
    trust: correction of z in flight by the outcome of earlier forecasts; None for none.
    """

    configuration: (
        str  # a key of `ENCODERS`; a label only, as all that flies is in the other fields
    )
    system: LiftedLinearSystem  # offline lifted linear system at the training step
    # Phi of the instantaneous chi, a linear map of the last samples, or a family of systems that is
    # adapted in flight
    encoder: Phi | DelayEncoder | AdaptiveFamily
    window: int  # samples that are kept: for the encoder, the refit or the update of theta [1]
    chi_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    zeta_scale: np.ndarray  # (6,) scales used in training [N, N·m; m/s, rad/s]
    predicts_torque: bool  # whether rows 3:6 of C were trained
    summary: dict[str, Any] = dc.field(
        default_factory=dict
    )  # key figures of the training, for people
    ridge: float = (
        0.0  # precision of `system` as the prior of a refit [samples of unit size]; 0 for no refit
    )
    late: int = 0
    trust: Trust | None = None

    def __post_init__(self):
        require_configuration(self.configuration)
        kind = ENCODERS[self.configuration]
        require(
            isinstance(self.encoder, kind),
            f"LiftedModel: {self.configuration} must have {kind.__name__}.",
        )
        require(
            self.encoder.K == self.system.K,
            f"LiftedModel: encoder and system must agree on K; got {self.encoder.K} and "
            f"{self.system.K}.",
        )
        require(
            0 <= self.late < self.window,
            f"LiftedModel: late must be 0 to less than the window; got {self.late}.",
        )

    @property
    def warm_up(self) -> int:
        """Samples before the first forecast: those that the encoder sees, or that the refit
        reads.
        """
        return self.encoder.delay if isinstance(self.encoder, AdaptiveFamily) else self.window

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return self.system.step

    @property
    def without_network(self) -> "LiftedModel":
        """Model of the same family without the network, where there is one; else the model
        itself.
        """
        if not isinstance(self.encoder, NeuralFamily):
            return self
        return dc.replace(self, configuration=LIFTED, encoder=self.encoder.plain)

    def since_label(self, window: np.ndarray) -> np.ndarray:
        """Return the zeta (..., late, 6) from the time of the newest label on, of samples (..., n,
        12).
        """
        n = window.shape[-2]
        return window[..., n - 1 - self.late : n - 1, 6:]


def require_configuration(name: str) -> None:
    """Check that a configuration of that name exists.

    Raises: ValueError: if there is none.
    """
    require(
        name in ENCODERS, f"configuration must be {' | '.join(ENCODERS)}; got {name}. Train again."
    )


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
LONGEST_WINDOW, LARGEST_RIDGE = 100_000, 1e12


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


SCHEMA = "np_drake.lifted_model/1"  # format of the file and its version
# What building a model of damaged content raises.
_DAMAGED = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError)


def save_model(model: LiftedModel, path: str | Path) -> None:
    """Write the model file, whole or not at all.
    Raises: OSError: if it cannot be written.
    """
    s = model.system
    tensors = {
        "A": s.A,
        "B": s.B,
        "C": s.C,
        "chi_scale": model.chi_scale,
        "zeta_scale": model.zeta_scale,
        **model.encoder.tensors(),
    }
    if model.trust is not None:
        tensors |= {
            f"trust/{name}": np.asarray(value, float) for name, value in vars(model.trust).items()
        }
    header = {
        "configuration": model.configuration,
        "step": s.step,
        "window": model.window,
        "predicts_torque": model.predicts_torque,
        "ridge": model.ridge,
        "summary": model.summary,
    }
    if model.late:
        header["late"] = model.late
    write_model(tensors, SCHEMA, header, path)


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


def load_model(path: str | Path) -> LiftedModel:
    """Return the model in a file.

    Raises: ValueError: as `read_model`.
    """
    return read_model(path, SCHEMA, _model)


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


def _model(tensors: dict[str, np.ndarray], header: dict[str, Any]) -> LiftedModel:
    configuration = str(header["configuration"])
    window = int(number_in(header, "window", 1, LONGEST_WINDOW))
    require_configuration(configuration)
    system = LiftedLinearSystem(
        tensors["A"], tensors["B"], tensors["C"], number_in(header, "step", *STEPS)
    )
    if system.spectral_radius > 1.0 + 1e-9:
        raise ValueError(f"A must be stable; its spectral radius is {system.spectral_radius:.6g}.")
    for name in ("chi_scale", "zeta_scale"):
        require(
            tensors[name].shape == (6,) and np.all(tensors[name] > 0),
            f"{name} must be six positive numbers.",
        )
    told = header["predicts_torque"]  # a text would count as true
    require(isinstance(told, bool), f"predicts_torque must be true or false; got {told!r}.")
    encoder = ENCODERS[configuration].from_tensors(tensors)
    return LiftedModel(
        configuration,
        system,
        encoder,
        window,
        tensors["chi_scale"],
        tensors["zeta_scale"],
        told,
        summary_in(header),
        number_in(header, "ridge", 0.0, LARGEST_RIDGE),
        int(number_in({"late": 0} | header, "late", 0, LONGEST_WINDOW)),
        _trust(tensors, system.K),
    )


def _trust(tensors: dict[str, np.ndarray], K: int) -> Trust | None:
    found = {
        name.removeprefix("trust/"): value
        for name, value in tensors.items()
        if name.startswith("trust/")
    }
    if not found:
        return None
    horizons = found.pop("horizons").astype(int)
    arrays = {name: found.pop(name) for name in ("readout", "projector", "mean")}
    H = len(horizons)
    shapes = {"readout": (H, 6, K), "projector": (K, H, 6), "mean": (6,)}
    require(
        all(arrays[name].shape == shape for name, shape in shapes.items()),
        f"the arrays of trust must be {shapes}.",
    )
    require(
        H != 0 and horizons[0] >= 1 and not np.any(np.diff(horizons) < 1),
        "the horizons of trust must be whole numbers from 1 on, ascending.",
    )
    return Trust(
        horizons,
        arrays["readout"],
        arrays["projector"],
        arrays["mean"],
        **{name: value.item() for name, value in found.items()},
    )


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
