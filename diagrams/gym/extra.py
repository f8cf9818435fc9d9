"""The optional extra `gym`: gymnasium, imported when it is asked for."""

from importlib.util import find_spec


def installed() -> bool:
    """Return whether gymnasium is installed."""
    return find_spec("gymnasium") is not None


def require_gymnasium() -> None:
    """Raise ImportError, one line with the remedy, where gymnasium is not installed."""
    if not installed():
        raise ImportError("diagrams.gym: gymnasium must be installed; pip install 'np_drake[gym]'.")
