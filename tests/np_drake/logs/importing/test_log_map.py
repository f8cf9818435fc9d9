"""Laws of conversion: a quantity in any frame, unit and order is the same quantity."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.logs.importing.log_map import (
    BODIES,
    UNITS,
    WORLDS,
    LogMap,
    Source,
    convert,
    convert_quantity,
)

VECTORS = ("position", "velocity", "rates", "acceleration")
XYZ = ["x", "y", "z"]


def one(name, values, **fields):
    """Convert one row of one quantity with fields of its source."""
    log_map = LogMap(**{name: Source(XYZ[: len(values)], **fields)})
    return convert_quantity(name, np.array([values], float), log_map)[0]


@given(st.integers(1, 14), st.floats(10.0, 4000.0))
def test_an_electrical_speed_is_that_of_the_rotor_times_its_pole_pairs(pairs, speed):
    electrical = speed * 60 / (2 * np.pi) * pairs
    log_map = LogMap(
        rotor_speed=Source(["a", "b", "c", "d"], unit="erpm", pole_pairs=pairs)
    ).check()
    assert np.allclose(convert_quantity("rotor_speed", np.full((1, 4), electrical), log_map), speed)


@pytest.mark.parametrize(
    "name, unit, value, si",
    [
        ("rates", "deg/s", 180.0, np.pi),
        ("acceleration", "g", 1.0, 9.80665),
        ("position", "mm", 1500.0, 1.5),
        ("velocity", "km/h", 36.0, 10.0),
        ("rotor_speed", "rpm", 60.0, 2 * np.pi),
        ("rotor_speed", "Hz", 1.0, 2 * np.pi),
        ("thrust", "gf", 1000.0, 9.80665),
        ("throttle", "us", 1250.0, 0.25),
        ("throttle", "pwm16", 65535.0, 1.0),
        ("voltage", "mV", 11100.0, 11.1),
    ],
)
def test_units_are_what_they_say(name, unit, value, si):
    fields = {"kind": "acceleration", "axes": "world"} if name == "acceleration" else {}
    size = 3 if name in VECTORS else 1
    assert np.allclose(one(name, [value] * size, unit=unit, **fields), si, rtol=1e-12)


@st.composite
def maps(draw):
    """Draw conventions of every quantity by themselves."""
    attitude = draw(
        st.sampled_from([("wxyz", 4, ""), ("xyzw", 4, ""), ("wxyz", 3, "rad"), ("wxyz", 3, "deg")])
    )
    frames = st.sampled_from(list(itertools.product(("", *WORLDS), ("", *BODIES))))
    sources = {}
    for name in (*VECTORS, "torque"):
        world, body = draw(frames)
        sources[name] = Source(
            [name] * 3,
            unit=draw(st.sampled_from(["", *UNITS[name]])),
            scale=draw(st.sampled_from([1.0, -1.0, 0.5])),
            axes=draw(st.sampled_from(["", "world", "body"])) if name != "position" else "",
            kind=draw(st.sampled_from(["", "specific_force", "acceleration"]))
            if name == "acceleration"
            else "",
            world=world,
            body=body,
        )
    world, body = draw(frames)
    direction = draw(st.sampled_from(["body_to_world", "world_to_body"]))
    order, size, unit = attitude
    sources["attitude"] = Source(
        ["q"] * size, unit, order=order, direction=direction, world=world, body=body
    )
    sources["thrust"] = Source(["f"], scale=-1.0)
    return LogMap(
        world=draw(st.sampled_from(WORLDS)),
        body=draw(st.sampled_from(BODIES)),
        board_turn=draw(st.sampled_from([0.0, 90.0, -45.0])),
        **sources,
    ).check()


@settings(deadline=None, max_examples=50)
@given(log_map=maps(), seed=st.integers(0, 2**31))
def test_a_flight_in_any_conventions_is_the_same_flight(log_map, seed, conventions):
    rng = np.random.default_rng(seed)
    x = {name: rng.normal(size=(6, 3)) for name in (*VECTORS, "torque")}
    q = rng.normal(size=(6, 4))
    x |= {
        "attitude": q / np.linalg.norm(q, axis=1, keepdims=True),
        "thrust": rng.uniform(1, 9, (6, 1)),
    }
    dut = convert(conventions.columns_in(log_map, x), log_map)
    dut["attitude"] *= np.sign(np.sum(dut["attitude"] * x["attitude"], axis=1, keepdims=True))
    for name, value in x.items():
        assert np.allclose(dut[name], value, rtol=1e-9, atol=1e-9), name
