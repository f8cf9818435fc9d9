import numpy as np
import pytest
from scipy.integrate import solve_ivp

from np_drake import rigid_body
from np_drake.references.config import ReferenceConfig, make_reference
from np_drake.references.flatness import targets
from np_drake.references.harmonic import Multisine
from np_drake.vehicle import Vehicle

MOTIONS = [
    ReferenceConfig(),
    ReferenceConfig(track="lemniscate"),
    ReferenceConfig(track="hover"),
    ReferenceConfig(dither=[0.05, 0.05, 0.05]),
    ReferenceConfig(track="vertical", length=1.0, height=2.0),
    ReferenceConfig(track="steps", radius=0.7, speed=0.66, ramp=1.0),
    ReferenceConfig(track="multisine", amplitude=[0.3, 0.3, 0.1], band=[0.1, 0.6], seed=2),
]
STEPS = ReferenceConfig(track="steps", radius=0.7, speed=0.66, rest=2.0, ramp=1.0)


@pytest.mark.parametrize("config", MOTIONS)
def test_each_derivative_is_the_derivative_of_the_one_before(config):
    dut = make_reference(config)
    t, h = np.linspace(0.2, 9.0, 44), 1e-4  # no sample where the ramp ends
    slope = (dut.sample(t + h) - dut.sample(t - h)) / (2 * h)
    np.testing.assert_allclose(slope[:4], dut.sample(t)[1:], rtol=1e-5, atol=1e-5)  # h² truncation


@pytest.mark.parametrize("config", MOTIONS)
def test_motion_starts_at_rest(config):
    flat = make_reference(config).sample(np.array([0.0]))
    np.testing.assert_allclose(flat[1:], 0.0, atol=1e-12)


def test_circle_after_the_ramp_has_radius_and_speed():
    flat = make_reference(ReferenceConfig()).sample(np.linspace(6.0, 20.0, 50))
    np.testing.assert_allclose(np.hypot(flat[0, :, 0], flat[0, :, 1]), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(flat[1], axis=1), 1.5, rtol=1e-9)


def test_lemniscate_has_the_mean_speed_asked():
    dut = make_reference(ReferenceConfig(track="lemniscate"))
    flat = dut.sample(5.0 + np.linspace(0, 2 * np.pi / dut.rate, 4000, endpoint=False))
    assert np.mean(np.linalg.norm(flat[1], axis=1)) == pytest.approx(1.5, rel=1e-6)
    assert np.ptp(flat[0, :, 0]) == pytest.approx(3.0, rel=1e-5)


def test_the_vertical_lemniscate_stays_in_its_plane_and_heights():
    dut = make_reference(ReferenceConfig(track="vertical", length=1.0, rise=0.5, height=2.0))
    flat = dut.sample(5.0 + np.linspace(0, 2 * np.pi / dut.rate, 4000, endpoint=False))
    assert (flat[0, :, 1] == 0.0).all()
    x, z = flat[0, :, 0], flat[0, :, 2] - 2.0
    np.testing.assert_allclose(z**2, x**2 * (1.0 - x**2), atol=1e-12)  # (z/rise)² = 4 x² (1 - x²)
    assert np.mean(np.linalg.norm(flat[1], axis=1)) == pytest.approx(1.5, rel=1e-6)


def test_steps_rest_at_every_corner_of_the_square_in_turn():
    dut = make_reference(STEPS)
    side = 0.7 * np.sqrt(2)
    period = side / 0.66 + 2.0  # [s]
    t = STEPS.ramp + np.arange(9) * period - 1.0  # in the middle of the rests
    flat = dut.sample(t)
    half = side / 2
    corners = [[half, half], [-half, half], [-half, -half], [half, -half]]
    np.testing.assert_allclose(flat[0, :, :2], [corners[k % 4] for k in range(9)], atol=1e-12)
    np.testing.assert_allclose(flat[0, :, 2], STEPS.height)
    assert (flat[1:] == 0.0).all()


def test_a_step_has_the_mean_speed_asked_and_no_jump_up_to_the_jerk():
    dut = make_reference(STEPS)
    move = 0.7 * np.sqrt(2) / 0.66  # [s]
    begin, h = STEPS.ramp, 1e-6
    ends = dut.sample(np.array([begin, begin + move]))
    assert np.linalg.norm(ends[0, 1] - ends[0, 0]) / move == pytest.approx(0.66)
    around = dut.sample(np.array([begin - h, begin + h, begin + move - h, begin + move + h]))
    np.testing.assert_allclose(around[1:4, ::2], around[1:4, 1::2], atol=1e-3)  # [m/s³]: 2 h snap


@pytest.mark.parametrize("config", MOTIONS)
def test_feed_forward_flies_the_reference_open_loop(config):
    vehicle, dut = Vehicle(), make_reference(config)
    chi = np.array([0.4, -0.3, -2.5, 0.01, 0.02, -0.005])

    def rate(t, x):
        u = targets(vehicle, dut.sample(np.array([t])), chi[None])[1][0]
        return rigid_body.state_derivative(vehicle, x, u, chi)

    x0 = targets(vehicle, dut.sample(np.array([0.0])), chi[None])[0][0]
    end = solve_ivp(rate, (0.0, 6.0), x0, rtol=1e-8, atol=1e-9).y[:, -1]
    x_ref = targets(vehicle, dut.sample(np.array([6.0])), chi[None])[0][0]
    # [m]; open loop, unstable: errors grow
    np.testing.assert_allclose(end[:3], x_ref[:3], atol=1e-3)
    np.testing.assert_allclose(end[10:], x_ref[10:], atol=1e-3)  # [rad/s]


@pytest.mark.parametrize(
    "bad",
    [
        {"track": "spiral"},
        {"dither": [0.1]},
        {"ramp": -1.0},
        {"track": "vertical", "rise": 2.0},
        {"track": "circle", "corners": "stop"},
        {"amplitude": [0.1, 0.1, -0.1]},
        {"band": [0.5, 0.2]},
    ],
)
def test_impossible_reference_is_refused(bad):
    with pytest.raises(ValueError, match="ReferenceConfig"):
        make_reference(ReferenceConfig(**bad))


def test_dither_starts_without_offset():
    start = Multisine([0.1, 0.05, 0.02], ramp=1.0).sample(np.zeros(1))
    np.testing.assert_allclose(start, 0.0, atol=1e-12)


def test_a_multisine_is_random_of_the_sizes_asked_within_its_band():
    config = ReferenceConfig(
        track="multisine", amplitude=[0.3, 0.2, 0.1], band=[0.2, 0.8], ramp=1.0
    )
    t = np.arange(10.0, 1010.0, 0.1)
    p = make_reference(config).sample(t)[0]
    np.testing.assert_allclose(p.std(axis=0), [0.3, 0.2, 0.1], rtol=0.02)
    power = np.abs(np.fft.rfft(p - p.mean(axis=0), axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(t), 0.1)
    band = (frequency > 0.19) & (frequency < 1.03)  # of x; the others up to 1.27 times higher
    assert (power[band].sum(axis=0) > 0.99 * power.sum(axis=0)).all()
    again = ReferenceConfig(track="multisine", seed=1)
    assert not np.allclose(make_reference(again).sample(t)[0], p)
