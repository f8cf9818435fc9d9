"""Public names of a package that are imported when they are first asked for."""

import sys
from importlib import import_module
from typing import Any


def lazy_name(package: str, names: dict[str, str], name: str) -> Any:
    """Return a public name of a package and keep it there, so that it is imported once.

    Args:
        package: dotted name of the package, its `__name__`.
        names: {public name: dotted module that defines it}; a module stands for itself.
        name: that is asked for.
    Raises: AttributeError: if it is none of the public names.
    """
    if name not in names:
        raise AttributeError(
            f"module {package!r} has no attribute {name!r}; it offers {', '.join(sorted(names))}."
        )
    module = import_module(names[name])
    value = module if names[name] == f"{package}.{name}" else getattr(module, name)
    setattr(sys.modules[package], name, value)
    return value
