"""Laws of model files: whole, alike for alike models, and never trusted."""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file

from np_drake.lifting.model.lifted_linear_system import Encoder, LiftedLinearSystem
from np_drake.lifting.model.lifted_model import (
    MODE_DICTIONARY,
    PAPER,
    SCHEMA,
    LiftedModel,
    load_model,
)
from np_drake.residual_models.lifted_predictor import LiftedPredictor
from np_drake.trained_model import require_origin, rotor_lag_of


def model(configuration: str) -> LiftedModel:
    generator = np.random.default_rng(0)
    A, B, C = 0.5 * np.eye(4), generator.standard_normal((4, 6)), generator.standard_normal((6, 4))
    scale = generator.uniform(0.5, 2.0, 6)
    E, *layers = (generator.standard_normal(shape) for shape in ((4, 60), (7, 4), (4, 7)))
    paper, dictionary = Encoder(E, tuple(layers)), Encoder(E, offset=np.ones(4))
    encoder = paper if configuration == PAPER else dictionary
    system, summary = LiftedLinearSystem(A, B, C, 0.02), {"samples": 7}
    return LiftedModel(configuration, system, encoder, scale, summary, 5, 0.5)


def rewrite(path: Path, change) -> None:
    """Tensors and header of a good file, changed by `change(tensors, header, metadata)`."""
    tensors = load_file(path)
    metadata = {"schema": SCHEMA, "model": ""}
    header = {"configuration": MODE_DICTIONARY, "step": 0.02, "refit": 5}
    header |= {"ridge": 0.5, "summary": {}}
    change(tensors, header, metadata)
    save_file(tensors, path, {**metadata, "model": json.dumps(header)})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    model(MODE_DICTIONARY).save(tmp_path / "model.safetensors")
    return tmp_path / "model.safetensors"


def test_equal_models_are_equal_files(tmp_path):
    # The library's order of names is drawn anew at every call: two of eight calls differ but for 1
    # in 128.
    for number in range(8):
        model(MODE_DICTIONARY).save(tmp_path / f"{number}.safetensors")
    assert len({path.read_bytes() for path in tmp_path.iterdir()}) == 1


@pytest.mark.parametrize("configuration", [PAPER, MODE_DICTIONARY])
def test_what_is_read_is_what_was_written(configuration, tmp_path):
    saved = model(configuration)
    saved.save(tmp_path / "m.safetensors")
    read = load_model(tmp_path / "m.safetensors")
    for name in ("configuration", "window", "summary", "refit", "ridge", "step"):
        assert getattr(read, name) == getattr(saved, name)
    for name in "ABC":
        np.testing.assert_array_equal(getattr(read.system, name), getattr(saved.system, name))
    window = np.random.default_rng(1).standard_normal((3, 5, 12))
    np.testing.assert_array_equal(read.encoder(window), saved.encoder(window))


def test_pickles_are_never_loaded(tmp_path):
    class Trap:
        def __reduce__(self):
            return (pytest.fail, ("a pickle was executed",))

    (tmp_path / "a.pkl").write_bytes(pickle.dumps(Trap()))
    torch.save({"A": torch.eye(3)}, tmp_path / "b.pt")
    for name in ("a.pkl", "b.pt"):
        with pytest.raises(ValueError, match=r"pickle .* never loaded"):
            load_model(tmp_path / name)


FAULTS = {
    "schema must be": lambda t, h, m: m.update(schema="np_drake.lifted_model/0"),
    "lacks 'E'": lambda t, h, m: t.pop("E"),
    r"must be paper \| neural-lpv \| mode": lambda t, h, m: h.update(configuration="theirs"),
    "each layer must take the 4": lambda t, h, m: t.update(W0=np.zeros((4, 5))),
    r"offset must be \(4,\)": lambda t, h, m: t.update(offset=np.zeros(3)),
    "positive ridge; got 5, 0": lambda t, h, m: h.update(ridge=0.0),
    "force_bandwidth must be positive": lambda t, h, m: h.update(
        summary={"origin": {"label": {"force_bandwidth": -1}}}
    ),
    "must hold finite floating": lambda t, h, m: t.update(B=np.zeros((4, 6), int)),
    r"A, B, C must be \(K, K\)": lambda t, h, m: t.update(B=np.zeros((3, 6))),
    r"E must be \(F, 12 D\)": lambda t, h, m: t.update(E=np.zeros((4, 59))),
    "agree on K": lambda t, h, m: t.update(E=np.zeros((3, 60)), offset=np.ones(3)),
    "A must be stable": lambda t, h, m: t.update(A=1.1 * np.eye(4)),
    "zeta_scale must be six positive": lambda t, h, m: t.update(zeta_scale=np.zeros(6)),
    "step must be a number from": lambda t, h, m: h.update(step=-1.0),
}


@pytest.mark.parametrize("message", FAULTS)
def test_every_fault_has_its_line(path, message):
    rewrite(path, FAULTS[message])
    with pytest.raises(ValueError, match=message) as caught:
        load_model(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("junk", [None, "x", float("inf"), float("nan"), -1, 1e300, [1], True])
@pytest.mark.parametrize(
    "field", ["refit", "step", "summary", "origin", "rotor_lag", "command_delay", "ridge", "label"]
)
def test_no_value_of_the_header_is_more_than_a_refusal(path, field, junk):
    def change(tensors, header, metadata):
        where = header["summary"] if field in ("origin", "rotor_lag", "command_delay") else header
        where[field] = junk
        if field == "label":
            header["summary"]["origin"] = {"label": junk, "mass": 1.0}

    rewrite(path, change)
    try:
        dut = load_model(path)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017
        return
    require_origin(dut, {"frame": "world"})
    assert 0 <= rotor_lag_of(dut) < 10  # [s]
    assert LiftedPredictor(dut).label.check()
