"""The generated parts of docs/ablation.md."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Figures = Sequence[Mapping[str, Any]]
"""Rows of docs/ablation.json."""

_WAYS = ("threshold", "frames", "two labels", "cut")
_SCORES = ("MODA", "precision", "recall", "IDF1", "IDSW", "Frag", "false_tracks")
_NAMES = ("MODA", "precision", "recall", "IDF1", "switches", "fragments", "false tracks")
_LAST = ("MODA", "IDF1", "IDSW", "Frag", "false_tracks")
_LAST_NAMES = ("MODA", "IDF1", "switches", "fragments", "false tracks")


def rewrite(page: str, figures: Figures) -> str:
    """The page with its marked parts made anew; the text around them stays."""
    for name, make in (("ways", _ways), ("last look", _last_look), ("smoothness", _smoothness), ("commits", _commits)):
        begin, end = f"<!-- {name}: begin, written by tools/ablation.py -->\n", f"<!-- {name}: end -->"
        if (page.count(begin), page.count(end)) != (1, 1):
            raise SystemExit(f"ablation.py: docs/ablation.md: found no single part marked {name!r}, expected one")
        before, _, rest = page.partition(begin)
        page = f"{before}{begin}{make(figures)}\n{end}{rest.partition(end)[2]}"
    return page


def _ordered(figures: Figures) -> Iterator[Mapping[str, Any]]:
    """Rows of the ways, the most views first; sets as they came."""
    own = [row for row in figures if row["part"] == "views"]
    yield from sorted(own, key=lambda row: (row["set"], -row["views"], _WAYS.index(row["way"])))


def _ways(figures: Figures) -> str:
    lines = _head(("set", "views", "way", *_NAMES), 3)
    for row in _ordered(figures):
        way = f"threshold {row['level']:g}" if row["way"] == "threshold" else row["way"]
        lines.append(_line([row["set"], row["views"], way, *_cells(row["finished"], _SCORES)]))
    return "\n".join(lines)


def _last_look(figures: Figures) -> str:
    lines = _head(("set", "views", *(f"{name}, {when}" for name in _LAST_NAMES for when in ("before", "after"))), 2)
    for row in _ordered(figures):
        if row["way"] == "cut":
            before, after = _cells(row["committed"], _LAST), _cells(row["finished"], _LAST)
            pairs = [cell for pair in zip(before, after, strict=True) for cell in pair]
            lines.append(_line([row["set"], row["views"], *pairs]))
    return "\n".join(lines)


def _smoothness(figures: Figures) -> str:
    own = [row for row in figures if row["part"] == "smoothness"]
    lines = _head(("set", "smoothness, nats", "MODA", "IDF1", "switches", "greatest change of MODA"), 1)
    for name in sorted({row["set"] for row in own}):
        rows = sorted((row for row in own if row["set"] == name), key=lambda row: row["smoothness"])
        moda = [row["finished"]["MODA"] for row in rows]
        for row in rows:
            cells = _cells(row["finished"], ("MODA", "IDF1", "IDSW"))
            change = f"{max(moda) - min(moda):.2f}" if row is rows[-1] else ""
            lines.append(_line([name, f"{row['smoothness']:g}", *cells, change]))
    return "\n".join(lines)


def _commits(figures: Figures) -> str:
    commits = sorted({row["commit"] for row in figures})
    return f"Measured at {', '.join(f'`{commit}`' for commit in commits) or 'no commit yet'}."


def _cells(scores: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    return [_cell(scores[name]) for name in names]


def _cell(value: float | None) -> str:
    return "-" if value is None else str(value) if isinstance(value, int) else f"{value:.1f}"


def _head(names: Sequence[str], texts: int) -> list[str]:
    return [_line(names), _line(["---"] * texts + ["--:"] * (len(names) - texts))]


def _line(cells: Sequence[object]) -> str:
    return f"| {' | '.join(map(str, cells))} |"
