"""Phases of offboard control: when the vehicle is commanded, levelled, or left to its autopilot."""

import dataclasses as dc
from enum import Enum

from np_drake.offboard.config import CLEAR, OffboardConfig


class Phase(Enum):
    """What is sent."""

    WAITING = "waiting"  # nothing, until all is in order
    READY = "ready"  # a hold where the vehicle is; the autopilot has not handed over
    FLYING = "flying"  # the controller's commands
    LEVEL = "level"  # level thrust
    STOPPED = "stopped"  # nothing, for good

    @property
    def sends(self) -> bool:
        """Whether anything is sent."""
        return self not in (Phase.WAITING, Phase.STOPPED)


@dc.dataclass(frozen=True)
class Phases:
    """Phase of a flight and the times that lead to the next; a new one waits.

    WAITING -> READY after `settle` in order, with the autopilot in a mode of its own. READY ->
    FLYING as its mode changes to offboard: a vehicle that is in it already is not taken. FLYING ->
    LEVEL on a problem. LEVEL -> FLYING once it is over, or STOPPED `level` seconds after it began.
    A problem that returns within `settle` goes on with the same time. FLYING and LEVEL -> STOPPED
    as the autopilot leaves offboard. There is one flight: an autopilot whose failsafe is over may
    be in offboard again, with nobody having handed over.
    """

    phase: Phase = Phase.WAITING
    reason: str = ""  # of the last change
    in_order_since: float | None = None  # [s]
    fault_since: float | None = (
        None  # beginning of the problem, kept for `settle` after its end [s]
    )
    was_engaged: bool = True

    def advanced(
        self, now: float, *, problem: str, engaged: bool, config: OffboardConfig
    ) -> "Phases":
        """Return what follows at a time.

        Args:
            now: not before that of the last call [s].
            engaged: whether the autopilot is armed and follows what is sent.
        """
        since = None if problem else now if self.in_order_since is None else self.in_order_since
        in_order = 0.0 if since is None else now - since
        phase, reason = self._next(
            now, problem=problem, engaged=engaged, in_order=in_order, config=config
        )
        fault = self.fault_since
        if phase in (Phase.WAITING, Phase.READY) or (
            phase is Phase.FLYING and in_order >= config.settle
        ):
            fault = None
        elif phase is Phase.LEVEL and fault is None:
            fault = now
        return Phases(phase, self.reason if phase is self.phase else reason, since, fault, engaged)

    def _next(
        self, now: float, *, problem: str, engaged: bool, in_order: float, config: OffboardConfig
    ) -> tuple[Phase, str]:
        phase = self.phase
        if phase is Phase.WAITING:
            ready = not engaged and not problem and in_order >= config.settle
            return (Phase.READY, "all is in order") if ready else (phase, "")
        if phase is Phase.READY:
            if problem:
                return Phase.WAITING, problem
            return (
                (Phase.FLYING, "the autopilot has handed over")
                if engaged and not self.was_engaged
                else (phase, "")
            )
        if phase is Phase.STOPPED:
            return phase, ""
        if not engaged:
            return Phase.STOPPED, "the autopilot has taken over"
        spent = 0.0 if self.fault_since is None else now - self.fault_since
        over = self.fault_since is not None and spent >= config.level - 1e-9
        if phase is Phase.FLYING:
            return (Phase.STOPPED if over else Phase.LEVEL, problem) if problem else (phase, "")
        if over:
            return Phase.STOPPED, problem or self.reason
        return (Phase.FLYING, "in order again") if in_order >= CLEAR - 1e-9 else (phase, "")
