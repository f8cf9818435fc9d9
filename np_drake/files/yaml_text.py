"""Text of YAML files within budgets: size, nodes with all aliases expanded, depth, and no tags of
other programs.
"""

from pathlib import Path
from typing import Any

import yaml

from np_drake.files.input_file import read_bytes

# Budgets, own choice; the largest file that the package writes, a corrected simulator, has 20 kB
# and 2,000 nodes.
MAX_BYTES = 10**6
MAX_NODES = 50_000  # values, with those that aliases repeat
MAX_DEPTH = 50
MAX_SCALAR = 10_000  # characters of a value
STANDARD = "tag:yaml.org,2002:"
TAGS = {
    f"{STANDARD}{name}" for name in ("str", "int", "float", "bool", "null", "map", "seq", "merge")
}
# The first needs no recursion and a twentieth of the time.
PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def read_yaml_text(path: str | Path, *, longest: int = MAX_SCALAR) -> str:
    """Return the text of a YAML file that any reader may take in.
    Raises: ValueError: if it is no UTF-8 text, no YAML or beyond the budgets; OSError: if it cannot
        be read.
    """
    try:
        text = read_bytes(path, MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError("must be a UTF-8 text file.") from error
    require_modest(text, longest=longest)
    return text


def read_yaml(path: str | Path, *, longest: int = MAX_SCALAR) -> Any:
    """Return the plain content of a YAML file.

    Args:
        path: of the file; errors are those of `read_yaml_text`.
    """
    return yaml.safe_load(read_yaml_text(path, longest=longest))


def quoted(text: str) -> str:
    """Return a text as a YAML value on one line, which any reader takes for that text."""
    return yaml.safe_dump(text, default_style='"', allow_unicode=True, width=float("inf")).strip()


def require_modest(text: str, *, longest: int = MAX_SCALAR) -> None:
    """Check a YAML text event by event, before anything is made of it.
    Raises: ValueError: if it is no YAML, beyond the budgets, or has a tag that is not of YAML's own
        values.
    """
    sizes: dict[str, int] = {}  # of what an anchor names, aliases expanded
    parts: list[tuple[str | None, int]] = [
        (None, 0)
    ]  # open collections: anchor, and nodes until now
    try:
        for event in yaml.parse(text, Loader=PARSER):
            if isinstance(event, yaml.NodeEvent):
                _require_event(event, len(parts), longest)
            if isinstance(event, yaml.CollectionStartEvent):
                parts.append((event.anchor, 1))
                continue
            if isinstance(event, yaml.CollectionEndEvent):
                anchor, size = parts.pop()
            elif isinstance(event, yaml.AliasEvent):
                anchor, size = None, sizes.get(event.anchor, 1)
            elif isinstance(event, yaml.ScalarEvent):
                anchor, size = event.anchor, 1
            else:
                continue
            if anchor is not None:
                sizes[anchor] = size
            parts[-1] = parts[-1][0], parts[-1][1] + size
            if parts[-1][1] > MAX_NODES:
                raise ValueError(
                    f"must hold at most {MAX_NODES} values, aliases expanded{_at(event)}."
                )
    except yaml.YAMLError as error:
        words = str(error).replace('in "<unicode string>", ', "in ").split()
        raise ValueError(" ".join(words)) from error


def _require_event(event: Any, depth: int, longest: int) -> None:
    if depth > MAX_DEPTH:
        raise ValueError(f"must be nested at most {MAX_DEPTH} deep{_at(event)}.")
    tag = getattr(event, "tag", None)
    if tag is not None and tag not in TAGS and tag != "!":
        short = tag.replace(STANDARD, "!!")
        raise ValueError(
            f"must hold plain values; got the tag {short[:40]}{_at(event)}. Leave it out."
        )
    if len(getattr(event, "value", "")) > longest:
        raise ValueError(f"must hold values of at most {longest} characters{_at(event)}.")


def _at(event: Any) -> str:
    return f" (line {event.start_mark.line + 1})"
