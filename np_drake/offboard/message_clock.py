"""Clock of a sender, by which the age of its messages is known."""

import dataclasses as dc

DRIFT = 1e-3  # by which the two clocks may run apart [1]; source: own choice, a hundred times a crystal's
RESTART = 1.0  # by which a stamp goes back where its sender has started anew [s]; source: own choice


@dc.dataclass
class MessageClock:
    """Offset of a sender's clock, from the message that took least time on its way.

    A delay that every message has is not seen.
    """

    offset: float = float("inf")  # our time less its stamp [s]
    heard: float = 0.0  # our time of the last message [s]
    newest: float = -float("inf")  # of the stamps [s]

    def hear(self, stamp: float, now: float) -> bool:
        """Take a message's stamp; return whether its sender has started anew.

        Args:
            stamp: by the sender's clock [s].
            now: our time [s].
        """
        restarted = stamp < self.newest - RESTART
        if restarted:
            self.offset, self.newest = float("inf"), stamp
        self.offset = min(self.offset + DRIFT * max(now - self.heard, 0.0), now - stamp)
        self.heard, self.newest = now, max(self.newest, stamp)
        return restarted

    def age(self, stamp: float, now: float) -> float:
        """Return the age of a message [s].

        Args:
            stamp: by the sender's clock [s].
            now: our time [s].
        """
        return now - (stamp + self.offset)
