from types import SimpleNamespace

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.gusts import BIN, binned, drags, factor, forces, instants, spans, width
from np_drake.effects.linear_drag import LinearDrag


def test_the_covariance_of_bins_is_that_of_averages():
    fine, time = 50, 0.25
    t = (np.arange(4 * fine) + 0.5) * BIN / fine
    exact = np.exp(-np.abs(t[:, None] - t) / time).reshape(4, fine, 4, fine).mean(axis=(1, 3))
    root = factor(4, BIN, 1.0, time, 0.0)
    np.testing.assert_allclose(root @ root.T, exact, atol=2e-4)


@pytest.mark.parametrize("step", [0.01, 0.02, 0.03, 0.04, 0.07, 0.2])
def test_bins_are_where_their_clock_says_at_every_rate(step):
    e = SimpleNamespace(
        t=3.0 + step * np.arange(round(5.0 / step)), grid=SimpleNamespace(step=step)
    )
    middle = instants(e) + 0.5 * (width(e) - step)
    np.testing.assert_allclose(binned(e, e.t[:, None])[:, 0], middle)
    (later,) = spans(e, instants(e)[:, None], 5.0)
    assert 5.0 <= later[0, 0] < 5.0 + width(e)


def test_the_force_of_a_drag_is_its_columns_times_its_figures(seen):
    e, d = seen(name="1", seed=1, seconds=8.0), (0.3, 0.2, 0.1)
    np.testing.assert_allclose(
        drags(e) @ d, forces(e, predicted_residual(e, [Term(LinearDrag(*d))])), atol=1e-9
    )
