"""What holds for every verb: `-h` prints its help, and an option that takes one value stands
once.
"""

from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

HELP = {"help_option_names": ["-h", "--help"]}


class _Once:
    """Refuses an option of one value that stands twice, of which the last would silently win."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words behind a verb or a group.
        Raises: ValueError: where an option of one value stands twice.
        """
        _require_once(self.make_parser(ctx), args)  # type: ignore[attr-defined]
        return super().parse_args(ctx, args)  # type: ignore[misc]


class Verb(_Once, TyperCommand):
    """Verb whose options stand once."""


class Group(_Once, TyperGroup):
    """Group of verbs whose own options stand once."""


class Verbs(typer.Typer):
    """Application, or a group of one, whose verbs keep to the rules of this file."""

    def __init__(self, **settings: Any):
        plain = {
            "cls": Group,
            "rich_markup_mode": None,
            "pretty_exceptions_enable": False,
        }  # markup would swallow [m]
        super().__init__(**(plain | {"context_settings": HELP} | settings))

    def command(  # type: ignore[override]
        self, name: str | None = None, *, context_settings: dict | None = None, **settings: Any
    ) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        """Return a decorator that registers a verb.

        Args:
            settings: passed to `Typer.command`.
        """
        return super().command(
            name, cls=Verb, context_settings=HELP | (context_settings or {}), **settings
        )


def _require_once(parser: Any, args: Sequence[str]) -> None:
    """Check that no option of one value stands twice.

    Raises: ValueError: where one does; usage errors of the parser, which would refuse the words
    later as well.
    """
    _, _, order = parser.parse_args(args=list(args))
    for parameter in order:
        several = getattr(parameter, "multiple", False) or getattr(parameter, "count", False)
        if order.count(parameter) > 1 and not several:
            name, times = max(parameter.opts, key=len), order.count(parameter)
            raise ValueError(
                f"{name} must stand once; it stands {times} times. Leave all but one out."
            )
