"""Laws of what is believed of payload and air, by condition."""

import numpy as np
import pytest

from np_drake.payload_filter import kernel
from np_drake.payload_filter.bank_options import CONDITIONAL, BankOptions
from np_drake.payload_filter.filter_bank import PendulumBank
from tests.np_drake.payload_filter.conftest import STEP, G

ENDLESS = (1e12,) * 4  # durations of conditions that do not change [s]


UNEQUAL = [{name: (1.0, 2.0)} for name in CONDITIONAL]


@pytest.mark.parametrize("bad", [*UNEQUAL, dict.fromkeys(CONDITIONAL, (1.0,)), {"lengths": ()}])
def test_unequal_or_too_few_conditions_or_lengths_are_refused_in_one_line(bad):
    with pytest.raises(ValueError, match=r"^BankOptions: [^\n]*same conditions[^\n]*$"):
        BankOptions(**bad)


def test_a_parameter_returns_to_its_prior_by_the_memory_of_its_condition():
    memory, push_time, steps = np.array([0.5, 1, 2, 4]), np.array([0.3, 0.6, 0.9, 1.2]), 20
    options = BankOptions(
        lengths=(0.8,), memory=tuple(memory), push_time=tuple(push_time), duration=ENDLESS
    )
    dut = PendulumBank(options, step=STEP, gravity=G)
    first = dut.initial_memory()
    now = {name: value.copy() for name, value in first.items()}
    columns = [kernel.THRUST_ERROR, kernel.DRAG, kernel.PUSH]
    now["mean"][:, columns] += 0.1
    for _ in range(steps):
        hover = np.array([0.0, 0.0, G, *np.zeros(3), 0.0, 0.0, -G])
        now = dut.step_on(now, hover, hover, np.full(3, np.nan), np.ones(3))
    left = (now["mean"] - first["mean"])[:, columns]
    times = np.column_stack([memory, memory, push_time])
    # two members, with and without payload, of each condition
    expected = np.repeat(0.1 * np.exp(-steps * STEP / times), 2, axis=0)
    np.testing.assert_allclose(left, expected, rtol=1e-6)
    # A parameter that nothing corrects stays as doubtful as it was
    error = np.arange(kernel.SIZE)[4:]
    found, before = (m["covariance"][:, error, error] for m in (now, first))
    np.testing.assert_allclose(found, before, rtol=1e-6)
