"""Tables on standard output: as wide as the terminal, and whole where a pipe or a file takes them."""

import re
import sys
from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table

_WHOLE = 10_000
"""Columns of what no terminal shows."""
_WORDS = ("camera", "view", "zone", "line", "recognised", "classes", "")
"""Headings of columns that are no numbers."""


def output_console() -> Console:
    """Standard output as a console without markup."""
    console = Console(highlight=False, markup=False)
    whole = Console(file=_Trimmed(), highlight=False, markup=False, width=_WHOLE)  # type: ignore[arg-type]
    return console if console.is_terminal else whole


class _Trimmed:
    """Standard output without blanks at the ends of lines: rich fills the lines of tables."""

    def write(self, text: str) -> None:
        sys.stdout.write(re.sub(" +$", "", text, flags=re.MULTILINE))

    def flush(self) -> None:
        sys.stdout.flush()


def table_of(headings: Sequence[str], rows: Iterable[Sequence[str]], title: str | None = None) -> Table:
    """A table without lines, whose columns are flush right but for names and words."""
    table = Table(box=None, padding=(0, 2, 0, 0), title=title, title_justify="left")
    for name in headings:
        table.add_column(name, justify="left" if name in _WORDS else "right")
    for row in rows:
        table.add_row(*row)
    return table
