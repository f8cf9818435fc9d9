"""What a notebook shows of an object: a short table, and a data frame where pandas is installed."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

SHOWN = "padding: 2px 12px 2px 0; text-align: left"


def html_table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()
) -> str:
    """Return a short HTML fragment: title, table and notes, in the colours of the notebook.

    Args:
        header: name of each column; none: a table without a head.
    """
    head = "".join(f'<th style="{SHOWN}">{escape(name)}</th>' for name in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="{SHOWN}">{escape(str(cell))}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    table = f"<table>{f'<tr>{head}</tr>' if header else ''}{body}</table>" if rows else ""
    below = "".join(f"<p>{escape(note)}</p>" for note in notes)
    return f"<div><p><b>{escape(title)}</b></p>{table}{below}</div>"


def data_frame(columns: Mapping[str, Any], *, index: str | None = None) -> Any:
    """Return the columns as a pandas DataFrame.

    Args:
        columns: values (n,) by name.
        index: name of the column that becomes the index; None: rows are counted.
    Raises: ImportError: one line, where pandas is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        remedy = "pip install 'np_drake[notebook]'"
        raise ImportError(
            f"to_dataframe: needs pandas, which is not installed; {remedy}."
        ) from error
    frame = pandas.DataFrame(dict(columns))
    return frame if index is None else frame.set_index(index)


def flattened(
    names: Mapping[str, Sequence[str]], values: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Return columns (n,) by their own names of arrays (n, k) that are there."""
    found: dict[str, np.ndarray] = {}
    for name, columns in names.items():
        if name in values:
            found |= dict(zip(columns, np.reshape(values[name], (-1, len(columns))).T, strict=True))
    return found
