"""Laws of alignment: identical times change nothing; rows at another rate follow the continuous
flight.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.logs.errors import LogError
from np_drake.logs.importing.alignment import align
from np_drake.logs.importing.log_map import LogMap, Source
from np_drake.logs.importing.signals import Signal

PLAIN = LogMap(
    command="held_after",
    acceleration=Source(["a"] * 3, kind="acceleration", axes="world"),
    **{name: Source([name] * 3) for name in ("position", "velocity", "rates", "torque")},
    attitude=Source(["q"] * 4),
    thrust=Source(["f"]),
)


def truth(t):
    """A banking circle: p, v, a are exact derivatives; the attitude turns evenly about a tilted
    axis.
    """
    axis = np.array([0.36, 0.48, 0.8])
    turn = 1.2 * t[:, None]
    return {
        "position": np.stack([np.cos(2 * t), np.sin(2 * t), 1 + 0.2 * np.sin(t)], axis=1),
        "velocity": np.stack([-2 * np.sin(2 * t), 2 * np.cos(2 * t), 0.2 * np.cos(t)], axis=1),
        "acceleration": np.stack(
            [-4 * np.cos(2 * t), -4 * np.sin(2 * t), -0.2 * np.sin(t)], axis=1
        ),
        "attitude": attitude.from_rotation_vector(turn * axis),
        "rates": 1.2 * axis + 0 * t[:, None],
        "thrust": 20 + np.sin(t)[:, None],
        "torque": np.stack([np.sin(t), np.cos(t), 0 * t], axis=1),
    }


def signals_at(rates, seconds=8.0):
    """Return every quantity at a rate of its own [Hz]; default 100."""
    out = {}
    for name in truth(np.zeros(1)):
        t = np.arange(0.0, seconds, 1.0 / rates.get(name, 100.0))
        out[name] = Signal(t, truth(t)[name])
    return out


@pytest.mark.parametrize("command", ["held_after", "averaged", "unknown"])
def test_on_identical_times_nothing_changes(command):
    signals = signals_at({})
    dut = align(signals, dc.replace(PLAIN, command=command))
    assert np.array_equal(dut.t, signals["attitude"].t)
    assert not dut.filled.any()
    for name, own in signals.items():
        exact = name not in ("attitude", "rates", "velocity")
        assert np.allclose(dut.values[name], own.values, rtol=0, atol=0 if exact else 1e-14), name


def test_a_command_that_was_held_until_its_row_moves_one_row_up():
    signals = signals_at({})
    dut = align(signals, dc.replace(PLAIN, command="held_before")).values["thrust"]
    assert np.array_equal(dut[:-1], signals["thrust"].values[1:])


@pytest.mark.parametrize(
    "slow, bound",  # at 10 Hz [m, m/s, 1, rad/s, m/s²]; chords would be off by 5 mm and 1 cm/s
    [
        ("position", 1e-3),
        ("velocity", 1e-3),
        ("attitude", 1e-9),
        ("rates", 1e-9),
        ("acceleration", 0.06),
    ],
)
def test_a_signal_of_another_rate_follows_the_flight_better_if_faster(slow, bound):
    errors = []
    for rate in (10.0, 20.0, 40.0):
        dut = align(signals_at({slow: rate}), PLAIN)
        true = truth(dut.t)
        inside = (dut.t > 0.5) & (dut.t < 7.5)
        value = dut.values[slow]
        if slow == "attitude":
            value = value * np.sign(np.sum(value * true[slow], axis=1, keepdims=True))
        errors.append(float(np.abs(value - true[slow])[inside].max()))
    assert errors[0] < bound
    assert errors[0] < 1e-9 or errors[2] < 0.3 * errors[0]


def test_accelerations_of_a_row_are_those_under_its_command():
    """A thrust that jumps at every row is in the row's acceleration, not in half in that of the
    next.
    """
    fast, rows = np.arange(0.0, 4.0, 1e-3), np.arange(0.0, 4.0, 1e-2)
    draw = np.random.default_rng(0).uniform(8.0, 12.0, len(rows))  # specific force [m/s²]
    k = np.searchsorted(rows, fast + 1e-9, side="right") - 1
    q = truth(fast)["attitude"]
    a = draw[k][:, None] * attitude.body_z(q) - [0.0, 0.0, 9.81]
    signals = signals_at({}, 4.0) | {
        "acceleration": Signal(fast, a),
        "thrust": Signal(rows, draw[:, None]),
    }
    dut = align(signals, dc.replace(PLAIN, rate=100.0))
    lift = np.sum(
        (dut.values["acceleration"] + [0.0, 0.0, 9.81]) * attitude.body_z(dut.values["attitude"]),
        axis=1,
    )
    assert np.corrcoef(lift[:-2], dut.values["thrust"][:-2, 0])[0, 1] > 0.99


def test_rates_and_velocity_that_are_missing_are_derived_and_said():
    signals = signals_at({})
    del signals["rates"], signals["velocity"]
    dut = align(signals, dc.replace(PLAIN, rates=Source(), velocity=Source()))
    true = truth(dut.t)
    inside = (dut.t > 0.2) & (dut.t < 7.8)
    assert np.abs(dut.values["rates"] - true["rates"])[inside].max() < 1e-6
    assert np.abs(dut.values["velocity"] - true["velocity"])[inside].max() < 0.02
    assert [finding.where for finding in dut.findings] == ["rates", "velocity"]


def test_rows_within_a_gap_of_the_state_are_marked():
    signals = signals_at({"position": 50.0})
    own = signals["position"]
    keep = (own.t < 3.0) | (own.t > 3.4)
    signals["position"] = Signal(own.t[keep], own.values[keep])
    dut = align(signals, PLAIN)
    assert dut.filled[(dut.t > 3.0) & (dut.t < 3.4)].all()
    assert not dut.filled[(dut.t < 2.97) | (dut.t > 3.45)].any()


@pytest.mark.parametrize("lacks", [(), ("velocity",)])
def test_gyro_and_accelerometer_bridge_a_gap_of_the_pose(lacks):
    signals = {name: own for name, own in signals_at({}).items() if name not in lacks}
    pose = [name for name in ("position", "velocity", "attitude") if name in signals]
    for name in pose:
        own = signals[name]
        keep = (own.t < 3.0) | (own.t > 3.6)
        signals[name] = Signal(own.t[keep], own.values[keep])
    dut = align(signals, dc.replace(PLAIN, **dict.fromkeys(lacks, Source())))
    gap = (dut.t > 3.0) & (dut.t < 3.6)
    assert dut.filled[gap].all()
    assert not dut.torn.any()
    for name, error in (("position", 5e-3), ("velocity", 0.02), ("attitude", 1e-6)):
        assert np.abs(dut.values[name] - truth(dut.t)[name])[gap].max() < error  # [m, m/s, 1]


def test_signals_that_do_not_overlap_are_refused():
    signals = signals_at({})
    late = signals["rates"]
    with pytest.raises(LogError, match="overlap in time"):
        align(signals | {"rates": Signal(late.t + 100.0, late.values)}, PLAIN)
