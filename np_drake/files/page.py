"""The project's HTML pages: sections of a template and its values, on one style sheet, with their
pictures inside.
"""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from np_drake.files.figure_file import Figure, png
from np_drake.files.file_access import write_bytes, write_text
from np_drake.files.number_text import kept_together

FOLDER = Path(__file__).parent  # of the templates and the style sheet
Pictures = Mapping[str, Figure | bytes | None]  # figure or PNG by name; None: there is none


class Section(NamedTuple):
    """Part of a page.

    template: file of HTML in the language of Jinja2, which may call `picture(name, alt, caption)`,
        `table(header, rows)` and `items(sentences)` of page_parts.html.j2.
    values: what it names.
    """

    template: Path
    values: Mapping[str, Any]


def write_page(
    path: Path, title: str, sections: Sequence[Section], pictures: Pictures, *, closed: bool = True
) -> Path:
    """Write a page, and its pictures as PNG files beside it, and return its path.

    All is made before anything is written. A picture that is None is deleted: it is of an earlier
    run.

    Args:
        closed: whether a browser is to refuse every address; not where the page frames another.
    Raises: OSError: if a file cannot be written.
    """
    made = {n: p if p is None or isinstance(p, bytes) else png(p) for n, p in pictures.items()}
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: kept_together(value) if type(value) is str else value,
    )
    environment.filters["longest_word"] = _longest_word
    shown = {name: base64.b64encode(p).decode() for name, p in made.items() if p}
    parts = environment.get_template("page_parts.html.j2").make_module({"pictures": shown})
    macros = {name: getattr(parts, name) for name in ("picture", "table", "items")}
    html = [
        Markup(environment.from_string(template.read_text("utf-8")).render(macros | {**values}))
        for template, values in sections
    ]
    style = Markup((FOLDER / "page.css").read_text("utf-8"))
    text = environment.get_template("page.html.j2").render(
        title=title, sections=html, style=style, closed=closed
    )
    for name, picture in made.items():
        file = path.with_name(f"{name}.png")
        if picture is None:
            file.unlink(missing_ok=True)
        else:
            write_bytes(file, picture)
    write_text(path, text)
    return path


def _longest_word(text: str) -> int:
    """Return the length of the longest part that no line is broken in, as a name of a file."""
    return max(map(len, text.split()), default=0)
