import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from np_drake.mpc.condensed import Condensed
from np_drake.mpc.ipopt import Preconditioned


def test_rows_left_out_are_added_once_violated(vehicle, config, make_problem):
    condensed = Condensed(vehicle, config)
    h = condensed.prepare(make_problem(config))
    start = condensed.rollout(h, np.full((config.horizon, 4), 6.0))
    dut = Preconditioned(condensed, h, start)
    assert not dut.add_violated(start)
    beyond = condensed.rollout(h, np.full((config.horizon, 4), 12.5))
    assert dut.add_violated(beyond)
    assert not dut.add_violated(beyond)  # now they are in


@pytest.mark.parametrize("name", ["_cost", "_rows"])
def test_what_ipopt_sees_has_the_right_gradient(vehicle, config, make_problem, name):
    condensed = Condensed(vehicle, config)
    h = condensed.prepare(make_problem(config, offset=0.3, tilt=0.3))
    dut = Preconditioned(condensed, h, condensed.rollout(h, np.full((config.horizon, 4), 5.5)))
    dut._soft[:] = True
    f, size = getattr(dut, name), condensed.size + (3 if name == "_rows" else 0)
    v, e = (scale * np.random.default_rng(0).normal(size=size) for scale in (0.1, 1e-5))
    gradient = ExtractGradient(np.atleast_1d(f(InitializeAutoDiff(v).ravel())))
    np.testing.assert_allclose(
        gradient @ e, 0.5 * np.atleast_1d(f(v + e) - f(v - e)), rtol=1e-5, atol=1e-11
    )
