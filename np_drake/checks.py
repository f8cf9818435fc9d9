"""The one way in which what a user gives is checked."""


def require(condition: object, otherwise: str, error: type[Exception] = ValueError) -> None:
    """Check what a user gives; the line `otherwise` says who, what it must be and what it is.

    Raises: `error` with that line, where the condition does not hold.
    """
    if not condition:
        raise error(otherwise)
