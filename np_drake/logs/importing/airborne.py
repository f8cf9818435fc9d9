"""Part of a log in which the vehicle flies."""

import numpy as np

MOVED = 0.05  # from where it rests before and after the flight [m]; own choice
RUNNING = 0.5  # share of the usual lift below which the rotors do not carry [1]; own choice


def airborne(t: np.ndarray, p: np.ndarray, lift: np.ndarray | None) -> slice:
    """Return the rows between take-off and landing; all rows where the log neither begins nor ends at rest.

    At rest the position stays within `MOVED` of that at the end of the log, and the rotors give less than `RUNNING` of
    their usual lift at that end.

    Args: t: (n,) [s].   p: (n, 3) [m].   lift: (n,) of the rotors in any unit, None where it is not known.
    """
    moved_first = np.linalg.norm(p - p[0], axis=1) > MOVED
    moved_last = np.linalg.norm(p - p[-1], axis=1) > MOVED
    if not moved_first.any():
        return slice(0, len(t))
    start, stop = int(np.argmax(moved_first)), len(t) - int(np.argmax(moved_last[::-1]))
    usual = None if lift is None else float(np.median(lift[start:stop]))
    begins_still = (
        usual is None or lift is None or float(np.median(lift[: max(start // 2, 1)])) < RUNNING * usual
    )
    ends_still = (
        usual is None or lift is None or float(np.median(lift[(stop + len(t)) // 2 :])) < RUNNING * usual
    )
    return slice(start if begins_still else 0, stop if ends_still else len(t))
