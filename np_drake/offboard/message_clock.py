"""Clock of a sender, by which the age of its messages is known."""

import dataclasses as dc

WINDOW = 5.0  # over which the quickest message is looked for, and as long again [s]; source: own choice
RESTART = 1.0  # by which a stamp goes back where its sender has started anew [s]; source: own choice


@dc.dataclass
class MessageClock:
    """Offset of a sender's clock, from the message that took least time on its way in the last 5 to 10 s.

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
            self.newest, self._least, self._before, self._ends = stamp, float("inf"), float("inf"), -float("inf")
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
