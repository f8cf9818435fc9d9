"""XML elements from numbers, and files of them."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from np_drake.files.atomic_file import write_text

Element = ElementTree.Element


def words(value: Any) -> str:
    """Return a number, or numbers separated by blanks, with all their digits; text as it is."""
    if isinstance(value, str):
        return value
    return " ".join(f"{float(x) + 0.0:.15g}" for x in np.ravel(value))


def put(parent: Element, tag: str, content: Any = None, **attributes: Any) -> Element:
    """Add an element and return it.

    Args:
        content: number, numbers or text; None for none.
    """
    element = ElementTree.SubElement(
        parent, tag, {name: words(value) for name, value in attributes.items()}
    )
    if content is not None:
        element.text = words(content)
    return element


def plain_name(name: str) -> str:
    """Return a name of letters, digits and underscores, as every format takes it."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "vehicle"


def write_xml(root: Element, path: str | Path, comment: str) -> None:
    """Write an XML file, whole or not at all."""
    ElementTree.indent(root)
    head = f'<?xml version="1.0"?>\n<!-- {comment.replace("--", "- -")} -->\n'
    write_text(path, head + ElementTree.tostring(root, encoding="unicode") + "\n")
