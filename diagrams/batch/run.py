"""Run and report of a study: a module with `Options`, its options, and `run(run, options) ->
Report`.

A study knows neither console nor files of its report. Called from Python it is silent:

    from diagrams.tracking import tuning
    report = tuning.run(Run(seed=1000), tuning.Options())

`np-drake reproduce` gives it a progress bar, prints the tables and writes what was asked for.
"""

import dataclasses as dc
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagrams.batch.workers import Workers
from np_drake.files.atomic_file import require_writable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from diagrams.batch.campaign import Case, Record

Advance = Callable[..., None]  # (done, text="")
Table = tuple[str, list[str], list[tuple]]  # title, header, rows


@contextmanager
def silent(description: str, total: float) -> Iterator[Advance]:
    """Yield an `advance(done, text)` that shows nothing.

    Args:
        total: value of `done` at the end [1].
    """
    yield lambda done, text="": None


@dc.dataclass(frozen=True)
class Run:
    """Seed, folders, workers and progress bar of one run.

    out: folder for figures and models; None: `scratch`.
    bar: shows progress, as `silent` does not.
    """

    seed: int = 0
    out: Path | None = None
    json: Path | None = None
    scratch: Path = dc.field(default_factory=lambda: Path(tempfile.mkdtemp(prefix="np_drake_")))
    workers: Workers = dc.field(default_factory=Workers)
    bar: Callable[[str, float], AbstractContextManager[Advance]] = silent

    @property
    def folder(self) -> Path:
        """Folder of `--out`, created on first use; without it a scratch folder that ends with the
        run.
        """
        return make_folder(self.out) if self.out else self.scratch

    def progress(self, title: str, total: float = 1.0) -> AbstractContextManager[Advance]:
        """Show a progress bar and yield `advance(done, text)`.

        Args:
            total: value of `done` at the end [1].
        """
        return self.bar(title, total)

    @contextmanager
    def counting(self, title: str, what: str = "") -> Iterator[Callable[[int, int], None]]:
        """Show a progress bar and yield `on_progress(done, total)`."""
        with self.bar(title, 1.0) as advance:
            yield counted(advance, what)

    def cases(
        self,
        title: str,
        what: str,
        work: "Callable[[Case], dict]",
        cases: "Sequence[Case]",
        **more: Any,
    ) -> "list[Record]":
        """Return the records of the cases, worked on behind a progress bar; without any, nothing is
        shown.

        Args:
            more: `config`, `part` and `keep` of `Workers.run`.
        """
        if not cases:
            return []
        with self.counting(title, what) as on_progress:
            return self.workers.run(work, cases, on_progress=on_progress, **more)


@dc.dataclass(frozen=True)
class NoOptions:
    """Options of a study that has none."""


@dc.dataclass(frozen=True)
class Report:
    """Tables of a run, and what its files hold."""

    tables: Sequence[Table]
    config: dict[str, Any]
    metrics: dict[str, Any]  # of --json, behind its head
    lines: Sequence[str] = ()  # printed above the tables
    summary: Sequence[str] = ()  # printed below the tables, and in the Markdown file
    notes: Sequence[str] = ()  # printed below the tables only
    figures: Mapping[str, Callable[[], "Figure"]] = dc.field(
        default_factory=dict
    )  # by file name in --out
    write: Callable[[Path], None] | None = None  # writes further files into the folder of --out
    failure: Exception | None = None  # raised when all is written and printed


def counted(advance: Advance, what: str = "") -> Callable[[int, int], None]:
    """Return an `on_progress(done, total)` that moves a bar of total 1."""
    return lambda done, total: advance(done / total, f"{done} of {total} {what}".rstrip())


def make_folder(path: Path) -> Path:
    """Return the folder of `--out`, created where it is missing.

    Raises: OSError: if nothing can be written in it.
    """
    path.mkdir(parents=True, exist_ok=True)
    require_writable(path / "any")
    return path
