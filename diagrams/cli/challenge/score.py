"""`np-drake challenge score`: answers against the truth, as tables, figures and JSON."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from diagrams.cli import options
from diagrams.cli.output import make_folder, print_table, progress, require_folder, say, write_metrics
from np_drake.atomic_file import require_writable, write_text


def score(
    answers: Annotated[
        Path, typer.Argument(metavar="ANSWERS", help="Folder of <case>/diagnosis.json, or of sets.")
    ],
    truth: Annotated[Path, typer.Argument(metavar="TRUTH", help="Folder of <case>/truth.json, or of sets.")],
    out: options.Out = None,
    visible: Annotated[
        float, typer.Option(metavar="RATIO", min=1.0, help="Visibility from which a case must be found [1].")
    ] = 1.5,
    misses: Annotated[bool, typer.Option("--misses", help="List every miss.")] = False,
    seed: options.Seed = 0,
    json: options.Json = None,
    markdown: options.Markdown = None,
) -> None:
    """Score the answers to a challenge set; with --out: figures. A case without an answer is a miss."""
    for file in (json, markdown):
        if file is not None:
            require_writable(file)
    if not math.isfinite(visible):
        raise ValueError(f"--visible must be finite; got {visible}.")
    if out is not None:
        require_folder(out)
    for folder in (answers, truth):
        if not folder.is_dir():
            raise ValueError(f"{folder}: must be a folder.")
    from diagrams.challenge.score.answered_case import read_answered_cases
    from diagrams.challenge.score.score import score as run
    from diagrams.challenge.score.tables import miss_table, set_lines, tables

    result = run(read_answered_cases(answers, truth), least=visible, seed=seed)
    shown = tables(result, visible) + ([miss_table(result)] if misses else [])
    for title, header, rows in shown:
        print_table(title, header, rows)
    say(*set_lines(result), *(f"warning: {text}" for text in result["warnings"]))
    if out is not None:
        draw(result, out)
    if markdown is not None:
        write_text(markdown, as_markdown(shown, set_lines(result)))
        say(f"table: {markdown}")
    config = {"answers": answers, "truth": truth, "visible": visible}
    write_metrics(json, "challenge_score", seed=seed, config=config, **result)


def draw(result: dict[str, Any], out: Path) -> None:
    """The figures, behind a progress bar."""
    from diagrams.challenge.score.figures import write_figures

    with progress("figures", 1.0) as advance:
        written = write_figures(result, make_folder(out))
        advance(1.0)
    say(f"figures: {', '.join(map(str, written))}")


def as_markdown(tables: Sequence[tuple[str, list[str], list[list[Any]]]], lines: Sequence[str]) -> str:
    """The tables and the lines under them."""
    parts = []
    for title, header, rows in tables:
        body = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
        body += ["| " + " | ".join(_cell(value) for value in row) + " |" for row in rows]
        parts.append("\n".join([f"{title}:", "", *body]))
    return "\n\n".join([*parts, "\n".join(f"- {line}" for line in lines)]) + "\n"


def _cell(value: Any) -> str:
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return text.strip().replace("|", "\\|")
