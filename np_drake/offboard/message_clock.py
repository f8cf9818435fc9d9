"""Clock of a sender, by which the age of its messages is known, and that of a node, which may wait
for it.
"""

import dataclasses as dc

from np_drake.offboard.codec import Heartbeat, Inertial, Pose, Said

WINDOW = (
    5.0  # over which the quickest message is looked for, and as long again [s]; source: own choice
)
RESTART = (
    1.0  # by which a stamp goes back where its sender has started anew [s]; source: own choice
)
# by which a node may be ahead of a simulated vehicle [s]; source: its messages come at 100 Hz
SLACK = 0.01
# Silence of a simulated vehicle after which it is not waited for, and time over which the rate of a
# clock is measured.
PATIENCE, SPAN = 1.0, 1.0  # [s]; source: own choice


@dc.dataclass
class MessageClock:
    """Offset of a sender's clock, from the message that took least time on its way in the last 5 to
    10 s.

    A delay that every message has is not seen.
    """

    newest: float = -float("inf")  # of the stamps [s]
    _least: float = float("inf")  # offset of this window: our time less a stamp [s]
    _before: float = float("inf")  # of the window before [s]
    _ends: float = -float("inf")  # of this window, our time [s]

    def hear(self, stamp: float, now: float) -> bool:
        """Take a message's stamp; return whether its sender has started anew.

        Args:
            stamp: by the sender's clock [s].
            now: our time [s].
        """
        restarted = stamp < self.newest - RESTART
        if restarted:
            self.newest, self._least, self._before, self._ends = (
                stamp,
                float("inf"),
                float("inf"),
                -float("inf"),
            )
        if now >= self._ends:
            self._before = self._least if now < self._ends + WINDOW else float("inf")
            self._least, self._ends = float("inf"), now + WINDOW
        self._least, self.newest = min(self._least, now - stamp), max(self.newest, stamp)
        return restarted

    def age(self, stamp: float, now: float) -> float:
        """Return the age of a message [s].

        Args:
            stamp: by the sender's clock [s].
            now: our time [s].
        """
        return now - (stamp + min(self._least, self._before))


@dc.dataclass
class NodeClock:
    """Time of a node: our clock, which waits for that of a vehicle that says that it is simulated.

    A simulated vehicle is as fast as its machine: all times of a node, those of its limits among
    them, are then the vehicle's. For any other vehicle they are ours.
    """

    waits: bool = False  # for the vehicle, which is simulated
    rate: float = float("nan")  # of the vehicle's clock over ours, as measured last [1]
    _lag: float = 0.0  # our clock less this one [s]
    _offset: float = 0.0  # this clock less a stamp [s]
    _newest: float = -float("inf")  # stamp [s]
    _moved: float = -float("inf")  # when that came, by our clock [s]
    _since: tuple[float, float] = (
        float("inf"),
        0.0,
    )  # beginning of the measurement of the rate: our clock, stamp [s]

    def read(self, ours: float, said: list[Said]) -> float:
        """Return the time [s].

        Args:
            ours: by our clock, not before that of the last call [s].
        """
        now = ours - self._lag
        for one in said:
            if isinstance(one, Heartbeat):
                self.waits = one.simulated
            elif (
                isinstance(one, Pose | Inertial) and not 0.0 <= self._newest - one.stamp <= RESTART
            ):
                if abs(one.stamp - self._newest) > RESTART:
                    self._offset, self._since = now - one.stamp, (ours, one.stamp)
                self._newest, self._moved = one.stamp, ours
        if self.waits and ours - self._moved < PATIENCE:
            theirs = self._newest + self._offset
            now = min(max(now, theirs), theirs + SLACK)
        else:
            self._offset = now - self._newest
        self._lag = ours - now
        if ours - self._since[0] >= SPAN:
            self.rate = (self._newest - self._since[1]) / (ours - self._since[0])
            self._since = (ours, self._newest)
        return now
