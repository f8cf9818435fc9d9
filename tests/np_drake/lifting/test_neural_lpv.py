"""Laws of the lifted linear system that a network schedules: of model, training and file."""

import dataclasses as dc

import numpy as np
import pytest
import scipy.signal
import torch
from hypothesis import given
from hypothesis import strategies as st

from np_drake.lifting.model.lifted_model import load_model, save_model
from np_drake.lifting.model.lpv_model import LPV_SCHEMA, PARAMETERS, lpv_tensors, units
from np_drake.lifting.training import neural_lpv
from np_drake.lifting.training.paper_training import IMAGES
from np_drake.lifting.training.train import train
from np_drake.residual_models.flight_forecasts import walk
from np_drake.residual_models.neural_predictor import NeuralPredictor
from np_drake.residual_models.predictor_training import fitted_lpv
from np_drake.skill.skill import skill_table
from np_drake.trained_model import write_model
from np_drake.training_data.segments import Flight, Segment, WrenchSequence, of_wrenches
from np_drake.vehicle import Vehicle

CONFIG = neural_lpv.NeuralLpvConfig(4, width=16, probes=8, glances=4, epochs=300, batch=128)
STEP = 0.02


def oscillator(seed: int, stiffness: float, level: float, hook: float = 0.02) -> Segment:
    """Force on a hook below: a swing that the velocity drives, on a level along z; noisy labels."""
    draw, t = np.random.default_rng(seed), STEP * np.arange(1200)[:, None, None]
    rate, phase = draw.uniform(1.0, 6.0, (2, 6, 4))
    zeta, poles = np.sin(t * rate + phase).sum(axis=2), [1, stiffness * STEP**2 - 1.994, 0.994]
    swing = scipy.signal.lfilter([0, STEP**2], poles, zeta[:, :3], axis=0)
    chi = np.hstack([swing + [0, 0, level], np.cross([0, 0, -hook], swing)])
    return Segment(chi + np.repeat([0.02, 0.002], 3) * draw.normal(size=(1200, 6)), zeta, STEP)


FLIGHT = oscillator(9, 12.0, -3.0)
ROWS, SEEN = np.hstack([FLIGHT.chi, FLIGHT.zeta]), neural_lpv.origins([FLIGHT], units(2.0, 1.0))
NETWORK = neural_lpv.LpvNetwork(CONFIG, SEEN).requires_grad_(False)
for parameter in NETWORK.parameters():
    parameter += 0.1 * torch.randn_like(parameter)  # none stays zero
MODEL = NETWORK.model(STEP).in_numpy()


def foreseen(model, rows: np.ndarray, at: int = 120) -> np.ndarray:
    """Every other wrench (21, 6) from sample `at` on, along the motion of rows [chi, zeta]."""
    dut, flight = NeuralPredictor.of(model), of_wrenches(rows[:, :6], rows[:, 6:], model.step)
    *_, (_, memory) = walk(dut, flight.rows(0, at + 1))
    motion = flight.zeta[at : at + 42].reshape(21, 2, 6).mean(axis=1)
    return dut.forecast(memory, horizon=21, stride=2).rollout(motion)


@pytest.mark.parametrize("number", [0, 30, 300])
def test_what_flies_is_what_was_trained(number):
    expected = NETWORK.forecast(*(part[number, None] for part in SEEN[:-1]))[0].numpy()
    found = foreseen(MODEL, ROWS, neural_lpv.EARLIEST + neural_lpv.SPACING * number)
    error = np.abs(found / MODEL.scale[:6] - expected).max(axis=0)
    assert error[:5].max() < 3e-4 * np.abs(expected).max()  # float32


@pytest.mark.parametrize("image", IMAGES)
@pytest.mark.parametrize(("mass", "clock"), [(2.0, 1.0), (0.25, 0.5), (40.0, 2.0)])
def test_a_flight_turned_or_of_another_size_is_forecast_alike(image, mass, clock):
    own = dc.replace(MODEL, scale=units(mass, clock), step=clock * STEP)
    ratio = np.repeat([mass / 2.0, mass / 2.0 * clock**2, clock, 1 / clock], 3)  # Froude
    found, expected = foreseen(own, ROWS @ image * ratio), foreseen(MODEL, ROWS) @ image[:6, :6]
    np.testing.assert_allclose((found / ratio[:6])[:, :5], expected[:, :5], atol=1e-9)  # no yaw


@given(st.lists(st.floats(-1e3, 1e3), min_size=PARAMETERS, max_size=PARAMETERS))
def test_no_network_makes_a_forecast_grow(theta):
    assert np.linalg.norm(MODEL.system(np.array(theta)).A, 2) <= 1.0 + 1e-12  # rounding


def test_other_loads_teach_the_force_and_one_flight_the_hook():
    found = train([oscillator(k, 8.0 + 4.0 * k, -(2.0**k)) for k in range(3)], CONFIG)
    flown, unseen = (oscillator(seed, 12.0, -3.0, hook=0.1) for seed in (7, 8))
    flights = [Flight(WrenchSequence(STEP, flown.chi, flown.zeta), Vehicle())]
    fitted = fitted_lpv(found.model, flights, STEP)
    duts = {"prior": NeuralPredictor.of(found.model), "fitted": NeuralPredictor.of(fitted)}
    options = {"horizons": [20], "mean": np.zeros(6), "warm_up": 60}
    rows = {r["model"]: r for r in skill_table(duts, unseen.chi, unseen.zeta, **options)}
    assert found.loss[-1] < 0.1 * found.loss[0]
    assert rows["fitted"]["force_ratio"] == rows["prior"]["force_ratio"] < 0.6  # of persistence
    assert rows["fitted"]["torque_ratio"] < 0.6 * rows["prior"]["torque_ratio"]


def test_what_is_read_from_a_small_file_is_what_was_written(tmp_path):
    network = neural_lpv.LpvNetwork(neural_lpv.NeuralLpvConfig(), SEEN).requires_grad_(False)
    saved = dc.replace(network.model(STEP).in_numpy(), summary={"samples": 7})
    save_model(saved, tmp_path / "m")
    np.testing.assert_equal(vars(load_model(tmp_path / "m")), vars(saved))
    assert (tmp_path / "m").stat().st_size < 2e6  # [B]


FAULTS = {
    "lacks 'b3'": {"W3": np.eye(16)},
    r"torque must be \(7,\); got \(6,\)": {"torque": np.ones(6)},
    "scale must be positive": {"scale": np.zeros(12)},
    "each layer must take the 16": {"W1": np.ones((16, 15))},
}


@pytest.mark.parametrize("message", FAULTS)
def test_every_fault_has_its_line(message, tmp_path):
    tensors, header = lpv_tensors(MODEL) | FAULTS[message], {"step": STEP, "summary": {}}
    write_model(tensors, LPV_SCHEMA, header, tmp_path / "m")
    with pytest.raises(ValueError, match=rf"\A.*{message}.*\Z"):
        load_model(tmp_path / "m")
