"""Requirements that flights must meet together to be diagnosed."""

from collections.abc import Sequence

import numpy as np

from np_drake.flight_log import FlightLog


def require_flights(train: Sequence[FlightLog], held_out: Sequence[FlightLog]) -> None:
    """Check names, inputs and accelerations of the flights, and that no held-out flight is a training flight.

    Raises: ValueError: if the flights cannot be diagnosed together; one line with the remedy.
    """
    for name, logs in (("train", train), ("held_out", held_out)):
        if not logs:
            raise ValueError(f"diagnose: {name} must hold at least one flight; got none.")
    names = [log.name for log in [*train, *held_out]]
    twice = {n for n in names if names.count(n) > 1}
    if twice:
        raise ValueError(
            f"diagnose: flights must have different names; got {sorted(twice)[0]!r} twice. "
            "Rename one, or give each flight once."
        )
    inputs = {log.input: log.name for log in reversed([*train, *held_out])}
    if len(inputs) > 1:
        got = " and ".join(f"{kind} ({name})" for kind, name in sorted(inputs.items()))
        raise ValueError(
            f"diagnose: all flights must have the same input; got {got}. Diagnose each kind by itself, or name an "
            "input that all have in the vehicle file (input: …)."
        )
    present = {log.name: log.a is not None for log in [*train, *held_out]}
    if len(set(present.values())) > 1:
        without = next(n for n, there in present.items() if not there)
        raise ValueError(f"diagnose: all flights or none must have accelerations; {without} has none.")
    seen = {log.name: _motion(log) for log in train}
    for log in held_out:
        own = _motion(log)
        same = next((name for name, rows in seen.items() if _same(own, rows)), None)
        if same is not None:
            raise ValueError(
                f"diagnose: {log.name} is the same flight as {same}, to which effects are fitted, and can judge none. "
                "Give one that was flown apart."
            )


def _motion(log: FlightLog) -> set[bytes]:
    """Return the distinct rows of p, v and w as bytes."""
    rows = np.concatenate([log.p, log.v, log.w], axis=1, dtype=float) + 0.0  # no zero has a sign
    return set(np.ascontiguousarray(rows).view(f"V{rows[:1].nbytes}").ravel().tolist())


def _same(held_out: set[bytes], train: set[bytes]) -> bool:
    """Return whether more than half of the distinct rows are also in the training flight; a single row is no motion."""
    return len(held_out) > 1 and 2 * len(held_out & train) > len(held_out)
