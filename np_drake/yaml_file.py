"""YAML files into checked dataclasses."""

from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed


def load_checked(schema: type, path: str | Path, kind: str) -> Any:
    """A `schema` from the YAML file at `path`; what the file does not name keeps its default; `check()` is run.

    Raises: ValueError: one line with file, field and reason, as "<path>: not a <kind>: …".
    """
    try:
        return yaml_load_typed(schema=schema, filename=str(path), defaults=schema()).check()
    except OSError as error:
        raise ValueError(f"{path}: not a {kind}: {error.strerror or error}.") from error
    except (yaml.YAMLError, RuntimeError, ValueError, TypeError, KeyError, AttributeError) as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{path}: not a {kind}: {reason[:300]}") from error
