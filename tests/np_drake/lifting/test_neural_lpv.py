"""Laws of the lifted linear system that a network schedules: of model, training and file."""

import dataclasses as dc

import numpy as np
import pytest
import scipy.signal
import torch
from hypothesis import given
from hypothesis import strategies as st

from np_drake.labels import RAW
from np_drake.lifting.model.lifted_model import load_model
from np_drake.lifting.model.lpv_model import LPV_SCHEMA, PARAMETERS
from np_drake.lifting.training import neural_lpv
from np_drake.lifting.training.paper_training import IMAGES
from np_drake.lifting.training.train import train
from np_drake.residual_models.flight_forecasts import walk
from np_drake.residual_models.lifted_predictor import LiftedLinearPredictor
from np_drake.residual_models.predictor_training import fitted_lpv
from np_drake.skill.skill import skill_table
from np_drake.trained_model import delay_of, label_of, write_model
from np_drake.training_data.segments import Flight, Segment, WrenchSequence, of_wrenches
from np_drake.vehicle import Vehicle
from tests.similar import similar

CONFIG = neural_lpv.NeuralLpvConfig(4, width=16, probes=8, glances=4, epochs=600, batch=128)
STEP = 0.02


def oscillator(seed: int, stiffness: float, level: float) -> Segment:
    """Force, a swing that the velocity drives on a level along z, at a hook below; noisy labels."""
    draw, t = np.random.default_rng(seed), STEP * np.arange(1200)[:, None, None]
    rate, phase = draw.uniform(1.0, 6.0, (2, 6, 4))
    zeta, poles = np.sin(t * rate + phase).sum(axis=2), [1, stiffness * STEP**2 - 1.994, 0.994]
    swing = scipy.signal.lfilter([0, STEP**2], poles, zeta[:, :3], axis=0)
    chi = np.hstack([swing + [0, 0, level], np.cross([0, 0, -0.02], swing)])
    return Segment(chi + np.repeat([0.02, 0.002], 3) * draw.normal(size=(1200, 6)), zeta, STEP)


FLIGHT = oscillator(9, 12.0, -3.0)
ROWS = np.hstack([FLIGHT.chi, FLIGHT.zeta])
SEEN = neural_lpv.origins([FLIGHT], np.repeat(CONFIG.units, 3))
NETWORK = neural_lpv.LpvNetwork(CONFIG, SEEN).requires_grad_(False)
torch.manual_seed(0)
for parameter in NETWORK.parameters():
    parameter += 0.1 * torch.randn_like(parameter)  # none stays zero
MODEL = NETWORK.model(STEP).in_numpy()


def foreseen(model, rows: np.ndarray, at: int = 120) -> np.ndarray:
    """Every other wrench (21, 6) from sample `at` on, along the motion of rows [chi, zeta]."""
    dut, flight = LiftedLinearPredictor.of(model), of_wrenches(rows[:, :6], rows[:, 6:], model.step)
    *_, (_, memory) = walk(dut, flight.rows(0, at + 1))
    motion = flight.zeta[at : at + 42].reshape(21, 2, 6).mean(axis=1)
    return dut.forecast(memory, horizon=21, stride=2).rollout(motion)


@pytest.mark.parametrize("row", [0, 30, 300])
def test_what_flies_is_what_was_trained(row):
    expected = NETWORK.forecast(*(part[row, None] for part in SEEN[:6]))[0].numpy()
    found = foreseen(MODEL, ROWS, neural_lpv.EARLIEST + neural_lpv.SPACING * row) / MODEL.scale[:6]
    assert np.abs(found - expected)[:, :5].max() < 1e-3 * np.abs(expected).max()  # float32


@pytest.mark.parametrize("image", IMAGES)
@pytest.mark.parametrize("length", [1.0, 0.25, 4.0])
def test_a_flight_turned_or_of_another_size_is_forecast_alike(image, length):
    sequence, clock = WrenchSequence(STEP, FLIGHT.chi, FLIGHT.zeta), np.sqrt(length)
    own = fitted_lpv(MODEL, [Flight(sequence, similar(Vehicle(), length))], clock * STEP)
    assert (own.step, label_of(own), delay_of(own)) == (clock * STEP, RAW, 0.0)
    ratio = np.repeat([length**3, length**4, clock, 1 / clock], 3)  # Froude
    found, expected = foreseen(own, ROWS @ image * ratio), foreseen(MODEL, ROWS) @ image[:6, :6]
    np.testing.assert_allclose((found / ratio[:6])[:, :5], expected[:, :5], atol=1e-9)  # no yaw


@given(st.lists(st.floats(-1e3, 1e3), min_size=PARAMETERS, max_size=PARAMETERS))
def test_no_network_makes_a_forecast_grow(theta):
    assert np.linalg.norm(MODEL.system(np.array(theta)).A, 2) <= 1.0 + 1e-12  # rounding


def test_other_loads_teach_the_force_of_an_unseen_one():
    loads = [oscillator(k, 8.0 + 4.0 * (k % 3), -(2.0 ** (k % 3))) for k in range(6)]
    dut = LiftedLinearPredictor.of(train(loads, CONFIG).model)
    rows = skill_table({"np": dut}, FLIGHT, horizons=[20], mean=np.zeros(6))
    [ratio] = [row["force_ratio"] for row in rows if row["model"] == "np"]
    assert ratio < 0.8  # of the error of persistence


def test_more_steps_on_other_flights_teach_their_force():
    others = [oscillator(k, 30.0, 1.0) for k in range(10, 13)]
    errors = []
    for epochs in (0, 100):
        tuned = neural_lpv.fine_tuned(MODEL, others[:2], epochs=epochs)
        network = neural_lpv.FineTunedNetwork(tuned).requires_grad_(False)
        error = network.errors(neural_lpv.origins(others[2:], MODEL.scale))[0]
        errors.append(float(error.square().mean()))
    assert errors[1] < 0.5 * errors[0]


def test_without_a_step_the_network_stays_what_it_was():
    tuned = neural_lpv.fine_tuned(MODEL, [FLIGHT], epochs=0)
    found, expected = tuned.content()[0], MODEL.content()[0]
    for name in expected:
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-6)  # float32


def test_what_is_read_from_a_small_file_is_what_was_written(tmp_path):
    network = neural_lpv.LpvNetwork(neural_lpv.NeuralLpvConfig(), SEEN).requires_grad_(False)
    saved = dc.replace(network.model(STEP).in_numpy(), summary={"samples": 7})
    saved.save(tmp_path / "m")
    found = load_model(tmp_path / "m")
    np.testing.assert_equal(found.content()[0], saved.content()[0])
    assert found.summary == saved.summary
    assert (tmp_path / "m").stat().st_size < 2e6  # [B]


FAULTS = {
    "lacks 'b3'": {"W3": np.eye(16)},
    r"torque must be \(7,\); got \(6,\)": {"torque": np.ones(6)},
    "scale must be positive": {"scale": np.zeros(12)},
    "each layer must take the 16": {"W1": np.ones((16, 15))},
}


@pytest.mark.parametrize("message", FAULTS)
def test_every_fault_has_its_line(message, tmp_path):
    tensors, header = MODEL.content()[0] | FAULTS[message], {"step": STEP, "summary": {}}
    write_model(tensors, LPV_SCHEMA, header, tmp_path / "m")
    with pytest.raises(ValueError, match=rf"\A.*{message}.*\Z"):
        load_model(tmp_path / "m")
