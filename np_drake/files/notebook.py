"""What a notebook shows of an object: a short table, and a data frame."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

SHOWN = "padding: 2px 12px 2px 0; text-align: left"


def html_table(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()
) -> str:
    """Return a short HTML fragment: title, table and notes, in the colours of the notebook.

    A table without a `header` has no head.
    """
    head = "".join(f'<th style="{SHOWN}">{escape(name)}</th>' for name in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="{SHOWN}">{escape(str(cell))}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    table = f"<table>{f'<tr>{head}</tr>' if header else ''}{body}</table>" if rows else ""
    below = "".join(f"<p>{escape(note)}</p>" for note in notes)
    return f"<div><p><b>{escape(title)}</b></p>{table}{below}</div>"


def data_frame(columns: Mapping[str, Any], *, index: str) -> Any:
    """Return columns (n,) as a pandas DataFrame, one of them as its index."""
    import pandas

    return pandas.DataFrame(dict(columns)).set_index(index)
