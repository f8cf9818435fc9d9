"""Public names of a package that are imported when they are first asked for."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_names(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package; a name that is asked for is
    imported once and kept there.

    The first raises AttributeError for what is none of the public names.

    Args:
        package: dotted name of the package, its `__name__`.
        file: its source, in which the public names are imported as themselves for a type checker.
    """
    tree = ast.parse(Path(file).read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    names = {one.name: node.module or "" for node in imports for one in node.names if one.asname}

    def get(name: str) -> Any:
        if name not in names:
            raise AttributeError(
                f"module {package!r} has no attribute {name!r}; it offers "
                f"{', '.join(sorted(names))}."
            )
        if names[name] == package:
            return import_module(f"{package}.{name}")
        value = getattr(import_module(names[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(sys.modules[package]), *names}), list(names)
