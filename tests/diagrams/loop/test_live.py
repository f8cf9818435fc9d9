"""Laws of the live view, into which messages of a browser are injected."""

import struct

import numpy as np
import pytest

from diagrams.loop.flight_result import fly
from diagrams.loop.live import PAYLOAD, SLIDERS, STOP, VEHICLE, LiveView
from tests.diagrams.loop.conftest import short


def config():
    return short("hover", ramp=0.3, duration=0.4)


def click(view, name):
    """What a browser sends when a button is clicked, in MessagePack."""
    text = b"".join(
        b"\xd9" + struct.pack(">B", len(part)) + part for part in (b"type", b"button", b"name")
    )
    view.meshcat._InjectWebsocketMessage(
        message=b"\x82" + text + b"\xd9" + struct.pack(">B", len(name.encode())) + name.encode()
    )


class Scripted(LiveView):
    """A view in which a button is clicked at a time."""

    def __init__(self, flown, name=None, at=0.2):
        super().__init__(flown, rate=0.0)
        self.name, self.at = name, at

    def look(self, context):
        if self.name and context.get_time() > self.at:
            click(self, self.name)
            self.name = None
        return super().look(context)


@pytest.fixture(scope="module")
def calm():
    return fly(config(), seed=0)


def test_a_push_moves_the_vehicle_along_its_force(calm):
    view = Scripted(config(), VEHICLE)
    view.meshcat.SetSliderValue(SLIDERS[0], 0.0)
    view.meshcat.SetSliderValue(SLIDERS[1], 0.25)
    moved = fly(config(), seed=0, watch=view).signals["x_true"] - calm.signals["x_true"]
    assert np.abs(moved[calm.signals["t"] < 0.2]).max() < 1e-6
    assert moved[-1, 1] > 0.02  # along y [m]
    assert abs(moved[-1, 0]) < 0.1 * moved[-1, 1]


def test_the_payload_is_pushed_by_its_own_button(calm):
    pushed = fly(config(), seed=0, watch=Scripted(config(), PAYLOAD))
    apart = pushed.payload_position - calm.payload_position
    assert apart[-1, 0] > 2 * abs(pushed.signals["x_true"][-1, 0] - calm.signals["x_true"][-1, 0])
    bare = config()
    bare.reality.payload.tether = "none"
    assert PAYLOAD not in LiveView(bare, rate=0.0).meshcat.GetButtonNames()


def test_stop_ends_the_flight_and_leaves_its_log():
    stopped = fly(config(), seed=0, watch=Scripted(config(), STOP, at=0.15))
    assert 0.1 < stopped.signals["t"][-1] < 0.25
    assert np.isfinite(stopped.metrics()["E_xy"])  # in the ramp all rows count


def test_a_flight_that_is_watched_is_the_same_and_shown_where_it_is(calm):
    view = Scripted(config())
    flight = fly(config(), seed=0, watch=view)
    expected = calm.signals["x_true"]  # of other steps
    np.testing.assert_allclose(flight.signals["x_true"], expected, atol=1e-6)
    for name, p_W in (("quadrotor", flight.flown), ("payload", flight.payload_position)):
        # Ends in the 16 numbers of X_WB, column by column, each behind the byte of its type.
        packed = view.meshcat._GetPackedTransform(path=name)[-144:]
        matrix = [struct.unpack(">d", packed[k + 1 : k + 9])[0] for k in range(0, 144, 9)]
        np.testing.assert_allclose(matrix[12:15], p_W[-1], atol=0.02)  # within a period [m]
