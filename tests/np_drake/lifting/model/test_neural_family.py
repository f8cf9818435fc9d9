"""Laws of a family of lifted linear systems with a network on top."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.lifting.model.adaptive_family import AdaptiveFamily, ModalAxis
from np_drake.lifting.model.lifted_model import LIFTED, NEURAL, LiftedModel
from np_drake.lifting.model.model_file import (
    load_model,
    read_tensors,
    save_model,
    schema_of,
    write_tensors,
)
from np_drake.lifting.model.neural_family import MOST, NeuralFamily, WindowNetwork, with_network
from np_drake.residual_model import Sample
from np_drake.residual_models.neural_predictor import NeuralPredictor

STEP, D, r = 0.02, 6, 2
PAIR = [
    [(0, 1.0), (6, 1.0), (10, 1.0)],
    [(1, 1.0), (7, 1.0), (9, -1.0)],
]  # f_x, v_x, w_y; f_y, v_y, -w_x
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def axis(views, rng):
    channels = np.zeros((len(views), len(views[0]), 12))
    for channel, view in zip(channels, views, strict=True):
        for row, (column, sign) in zip(channel, view, strict=True):
            row[column] = sign
    c = len(views[0])
    return ModalAxis(
        channels,
        channels[:, 0, :6],
        np.array([[np.log(3.0), 0.3, 0.0]]),
        np.array([[np.log(0.2), 0.0, 0.0]]),
        np.array([[np.log(0.1), 0.0, 0.1]]),
        0.05 * rng.standard_normal((3, c - 1, 1 + r)),
        0.3 * rng.standard_normal((3, c * D, 1 + r)),
    )


def family():
    rng = np.random.default_rng(0)
    axes = (axis(PAIR, rng), axis([[(2, 1.0), (8, 1.0)]], rng))
    lags = np.array([3.0, 5.0])
    return AdaptiveFamily(
        axes, np.array([0.1, -0.2]), np.diag([1.0, 0.25]), lags, np.full((2, 2), 0.05), 20.0
    )


def network(share=1.0, **changes):
    rng = np.random.default_rng(1)
    weights = [
        0.3 * rng.standard_normal(shape) for shape in ((8, 2 * 4 + 3 + r), (8, 8), (9 + r, 8))
    ]
    biases = [0.1 * rng.standard_normal(len(W)) for W in weights]
    fields = {"white": tuple(0.3 * rng.standard_normal(s) for s in ((4, 3 * D), (3, 2 * D)))}
    fields |= {
        "states": ((2, 3), (1, 3)),
        "weights": tuple(weights),
        "biases": tuple(biases),
        "share": share,
    }
    fields |= {"center": np.array([0.1, -0.2]), "spread": np.array([1.0, 0.5]), "size": np.ones(9)}
    return WindowNetwork(**fields | changes)


def model(share=1.0):
    dut = with_network(family(), network(share))
    return LiftedModel(
        NEURAL, dut.system(dut.mean, STEP), dut, dut.window, *np.ones((2, 6)), False, {"samples": 7}
    )


def flight(n=40):
    return np.cumsum(0.2 * np.random.default_rng(5).standard_normal((n, 12)), axis=0)


def forecasts(dut, samples):
    """Forecasts (n - D + 1, 4, 6) along a flight."""
    course = NeuralPredictor(dut).along(samples[:, :6], samples[:, 6:])
    origins = np.arange(course.first, len(samples) - 4)
    return course.at([0, 1, 2, 4], origins, samples[:, 6:], zeta_known=True)


def test_without_a_share_of_the_network_it_is_the_family():
    plain = model().without_network
    assert plain.configuration == LIFTED
    assert plain.without_network is plain
    np.testing.assert_allclose(
        forecasts(model(0.0), flight()), forecasts(plain, flight()), atol=1e-12
    )
    assert np.abs(forecasts(model(), flight()) - forecasts(plain, flight())).max() > 0.01


@pytest.mark.parametrize("turn", [QUARTER, QUARTER @ QUARTER, QUARTER.T], ids=["90", "180", "270"])
def test_what_is_felt_turned_is_foreseen_turned(turn):
    turned = flight() @ np.kron(np.eye(4), turn).T
    expected = forecasts(model(), flight())[..., :3] @ turn.T
    np.testing.assert_allclose(forecasts(model(), turned)[..., :3], expected, atol=1e-9)


def test_a_mirror_image_is_foreseen_as_one():
    mirror = np.array([1, -1, 1, -1, 1, -1.0])
    expected = forecasts(model(), flight()) * mirror
    np.testing.assert_allclose(
        forecasts(model(), flight() * [*mirror, *mirror])[..., :3], expected[..., :3], atol=1e-9
    )


def test_along_a_flight_it_is_what_it_is_sample_by_sample():
    dut, samples = NeuralPredictor(model()), flight()
    memory, course = dut.initial_memory(), dut.along(samples[:, :6], samples[:, 6:])
    assert set(memory) == set(
        NeuralPredictor(dc.replace(model(), configuration=LIFTED)).initial_memory()
    )
    for k, row in enumerate(samples, start=1):
        memory = dut.update(
            memory, Sample(np.array([0, 0, 1.0, 1, 0, 0, 0, *row[6:]]), np.zeros(4), row[:6])
        )
        if k >= D:
            forecast = dut.forecast(memory, horizon=3, stride=1)
            for name in "ABz":
                np.testing.assert_allclose(
                    getattr(course, name)[k - D], getattr(forecast, name), atol=1e-10
                )


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 1e9))
def test_the_correction_is_bounded_however_wild_the_window(size):
    dut = network()
    seen = [
        size * part for part in family().seen(np.random.default_rng(2).standard_normal((5, D, 12)))
    ]
    x = dut.inputs(seen, size * np.ones((5, r)))
    dz, change = dut.correction(x)
    unit = np.concatenate([dut.size, dut.spread])
    least, most = dut.correction(np.zeros_like(x)), dut.lipschitz_bound * MOST * np.sqrt(x.shape[1])
    moved = (np.concatenate([dz, change], axis=1) - np.concatenate(least, axis=1)) / unit
    assert np.linalg.norm(moved, axis=1).max() <= most
    system = with_network(family(), dut).system(family().mean + change[0], STEP)
    assert system.spectral_radius <= 1.0


def test_its_slope_is_at_most_that_of_its_layers():
    dut, rng = network(), np.random.default_rng(3)
    x = rng.standard_normal((200, 8 + 3 + r))
    shift = 1e-4 * rng.standard_normal(x.shape)
    unit = np.concatenate([dut.size, dut.spread])
    here, there = (np.concatenate(dut.correction(at), axis=1) / unit for at in (x, x + shift))
    slope = np.linalg.norm(there - here, axis=1) / np.linalg.norm(shift, axis=1)
    assert slope.max() <= dut.lipschitz_bound * (1 + 1e-6)


def test_the_file_holds_all_of_it(tmp_path):
    save_model(model(0.75), tmp_path / "m.safetensors")
    read = load_model(tmp_path / "m.safetensors", NEURAL)
    assert isinstance(read.encoder, NeuralFamily)
    np.testing.assert_array_equal(forecasts(read, flight()), forecasts(model(0.75), flight()))
    np.testing.assert_array_equal(read.lift(flight()[None]), model(0.75).lift(flight()[None]))


@pytest.mark.parametrize(
    "change, match",
    [
        ({"network/weights1": np.zeros((8, 7))}, "a layer must take the 8 outputs"),
        (
            {"network/weights2": np.zeros((10, 8)), "network/biases2": np.zeros(10)},
            "outputs must be z and theta",
        ),
        ({"network/white0": np.zeros((4, 10))}, "must see the family's windows"),
        ({"network/share": np.array([1.5])}, "share must be 0 to 1"),
        ({"network/size": np.full(9, np.nan)}, "must hold finite"),
        ({"network/share": None}, "lacks 'network/share'"),
    ],
)
def test_a_damaged_network_is_refused_in_a_line(change, match, tmp_path):
    save_model(model(), tmp_path / "m.safetensors")
    tensors, metadata = read_tensors(
        tmp_path / "m.safetensors", schema_of(tmp_path / "m.safetensors")
    )
    kept = {name: value for name, value in (tensors | change).items() if value is not None}
    write_tensors(kept, metadata, tmp_path / "m.safetensors")
    with pytest.raises(ValueError, match=match) as caught:
        load_model(tmp_path / "m.safetensors")
    assert "\n" not in str(caught.value)


def test_an_encoder_with_a_network_is_not_linear():
    with pytest.raises(TypeError, match="not linear"):
        _ = model().linear_encoder
