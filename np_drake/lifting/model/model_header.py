"""Header of a model file: its numbers within bounds, its truth values, and the summary of its
training.
"""

from typing import Any

# What a header may hold, own choice: beyond it a file is damaged.
STEPS = (1e-4, 10.0)  # shortest and longest step [s]
LONGEST_WINDOW, LARGEST_RIDGE = 100_000, 1e12


def summary_in(header: dict[str, Any]) -> dict[str, Any]:
    """Return the summary of a header.

    Raises: ValueError: if a part of it that a flight depends on is not what it must be; KeyError:
    if there is none.
    """
    summary = dict(header["summary"])
    if not isinstance(summary.get("origin", {}), dict):
        raise ValueError(
            f"summary.origin must be names with their values; got {summary['origin']!r}."
        )
    lag = summary.get("rotor_lag", 0.0)
    if not isinstance(lag, int | float) or not 0 <= lag < 10:
        raise ValueError(f"summary.rotor_lag must be 0 to 10 s; got {lag!r}.")
    return summary


def number_in(header: dict[str, Any], name: str, lowest: float, largest: float) -> float:
    """Return a number of a header.
    Raises: ValueError: if it is none, or outside these bounds; KeyError: if the header lacks it.
    """
    value = header[name]
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not lowest <= value <= largest
    ):
        raise ValueError(f"{name} must be a number from {lowest:g} to {largest:g}; got {value!r}.")
    return float(value)


def truth_in(header: dict[str, Any], name: str) -> bool:
    """Return a truth value of a header.
    Raises: ValueError: if it is none, as a text, which Python takes for true; KeyError: if the
        header lacks it.
    """
    if not isinstance(header[name], bool):
        raise ValueError(f"{name} must be true or false; got {header[name]!r}.")
    return header[name]
