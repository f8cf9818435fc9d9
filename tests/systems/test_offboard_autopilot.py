"""Laws of the autopilot as a system: what comes by the link is in force from the next event on."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.autopilot.mavlink import COMPANION, Codec, Command, Heartbeat, Inertial, Pose
from np_drake.rigid_body import P
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import RateLoop
from systems.offboard_autopilot import PERIOD, OffboardAutopilot
from tests.np_drake.autopilot.channel import Channel

pytest.importorskip("pymavlink", reason="messages need pymavlink")

VEHICLE = dc.replace(Vehicle(), rate_loop=RateLoop())
HOVER = [VEHICLE.mass * VEHICLE.gravity, 0.0, 0.0, 0.0]
X = np.array([1.0, 2.0, 3.0, 1.0, *np.zeros(9)])


class Flight:
    """The system in its Context, at the near end of a channel, and a companion at the far end."""

    def __init__(self, *, takes: float = 0.0) -> None:
        self.now = 0.0
        near, self.far = Channel.pair(lambda: self.now, lambda now: now + takes)
        self.dut = OffboardAutopilot(VEHICLE, near)
        self.context = self.dut.CreateDefaultContext()
        self.fix(x=X, acceleration=np.zeros(6))
        self.codec = Codec(COMPANION, 1)

    def fix(self, **values) -> None:
        for name, value in values.items():
            self.dut.GetInputPort(name).FixValue(self.context, value)

    @property
    def output(self) -> np.ndarray:
        return self.dut.GetOutputPort("rates_thrust").Eval(self.context)

    def event(self, t: float) -> list:
        """Update at a time, and return what was sent."""
        self.now = t
        self.context.SetTime(t)
        update = self.dut.EvalUniquePeriodicDiscreteUpdate(self.context)
        self.context.get_mutable_discrete_state().SetFrom(update)
        return [said for data in self.far.receive() for said in self.codec.parse(data)]

    def talk(self, begin: float, end: float) -> list:
        """A companion that sends commands, at 100 Hz; return what was sent last."""
        for k in range(round(begin / 0.01), round(end / 0.01)):
            self.now = 0.01 * k
            self.far.send(self.codec.command(self.now, np.array([0.1, 0.2, 0.3]), 0.5))
            said = self.event(0.01 * k)
        return said


@pytest.fixture
def flight() -> Flight:
    return Flight()


def test_before_the_first_event_it_gives_the_weight(flight):
    np.testing.assert_allclose(flight.output, HOVER)


def test_state_and_what_it_feels_and_what_is_in_force_are_sent(flight):
    flight.fix(acceleration=np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0]))
    said = flight.event(0.0)
    assert [type(one) for one in said] == [Heartbeat, Inertial, Pose, Command]
    beat, felt, pose, target = said
    assert not beat.engaged
    np.testing.assert_allclose(felt.f, [0.0, 0.0, VEHICLE.gravity + 2.0], rtol=1e-6)
    np.testing.assert_allclose(pose.x[P], X[P], rtol=1e-6)
    np.testing.assert_allclose(target.thrust, HOVER[0] / (4 * VEHICLE.max_rotor_thrust), rtol=1e-6)


def test_states_are_sent_every_ten_milliseconds_and_nothing_between(flight):
    sent = [any(isinstance(one, Pose) for one in flight.event(PERIOD * k)) for k in range(41)]
    assert sent == [k % 4 == 0 for k in range(41)]


def test_a_companion_that_is_heard_takes_command(flight):
    said = flight.talk(0.0, 3.0)
    np.testing.assert_allclose(
        flight.output, [2 * VEHICLE.max_rotor_thrust, 0.1, 0.2, 0.3], rtol=1e-6
    )
    target = next(one for one in said if isinstance(one, Command))
    np.testing.assert_allclose([target.thrust, *target.rates], [0.5, 0.1, 0.2, 0.3], rtol=1e-6)
    assert len(flight.dut.autopilot.handovers) == 1
