"""Effects that a kind of log cannot tell, and why."""

from np_drake.effects.library import unobservable


def unanswerable(log_input: str, *, accelerations: bool, torque: bool) -> dict[str, list[str]]:
    """Return the effects that a log with this input cannot tell, by reason.

    Args: log_input: as `FlightLog.input`.   accelerations, torque: whether the log has them.
    """
    found: dict[str, list[str]] = {}
    for identifier, reason in unobservable(log_input, accelerations=accelerations, torque=torque).items():
        found.setdefault(reason, []).append(identifier)
    return found
