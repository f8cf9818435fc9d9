import numpy as np
import pytest

from np_drake.mpc.condensed import Condensed
from tests.np_drake.mpc.reference_solver import StackedStages


@pytest.fixture(params=[False, True], ids=["linear", "reacting"])
def setup(request, vehicle, config, make_problem, reaction):
    condensed = Condensed(vehicle, config)
    problem = make_problem(
        config, offset=0.4, tilt=0.2, reaction=reaction if request.param else None
    )
    h = condensed.prepare(problem)
    return StackedStages(condensed), h, condensed.rollout(h, np.full((config.horizon, 4), 5.2))


def test_a_rollout_has_no_defects(setup, config):
    dut, h, t = setup
    rows, _ = dut.evaluate(h, dut.pack(t))
    np.testing.assert_allclose(rows[: 19 * config.horizon], 0.0, atol=1e-12)  # round-off
    assert rows[19 * config.horizon :].max() <= 1e-12  # its own slacks suffice


def test_the_jacobian_matches_finite_differences_and_its_pattern(setup):
    dut, h, t = setup
    values, eps = dut.pack(t), 1e-6
    _, jacobian = dut.evaluate(h, values)
    for k in range(dut.size):
        e = np.zeros(dut.size)
        e[k] = eps
        numeric = (dut.evaluate(h, values + e)[0] - dut.evaluate(h, values - e)[0]) / (2 * eps)
        np.testing.assert_allclose(jacobian[:, k], numeric, atol=1e-6)  # central differences
    assert not np.any(jacobian[~dut.pattern()])
