"""docs/development/measurements.md: results, spread, trackers side by side, peers, commands."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from result_peers import PEERS, Peer
from result_sets import SETS, ResultSet
from result_variants import VARIANTS, Variant

Figures = Mapping[str, Mapping[str, Any]]
"""Rows of docs/results.json by `set variant`."""

MAIN = (VARIANTS["cut"], VARIANTS["frames"])
"""The variants of the first table, of the spread, of the peers and of the commands."""

_PAGE = """# Measurements

Written by `python tools/results.py --all` from `docs/results.json`; edit neither. {commits}

The data sets are public, but not part of this repository. Everything goes through the command line of `stseg` with its
default constants, the same for all sets but for the size of a ground cell on `wildtrack` (0.20 m; 0.10 m elsewhere).
Scores are percent, errors metres. Matching is within the gate given (0.5 m). Times are of the processor.

## Results

{table}

## Spread

Crowds are chaotic: a box more or less changes who is mixed up with whom later. Mean and standard deviation over runs in
which one random box in 200 is missing or, where there are no boxes, one random frame of a view in 200.

{spread}

## Trackers side by side

{trackers}

## Peers

Other methods on the same frames: measured apart from this project with their authors' code, or read from the authors'
published tracks.

{peers}

## Commands

`$DATA` is the folder of data sets, `$WORK` the folder of work files.

{commands}
"""
_HEADINGS = (
    *("set", "tracker", "MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA", "switches", "fragments"),
    *("false tracks", "tracks", "error m", "frames/s", "measured on"),
)
_PERCENT = ("MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA")
_COUNTS = ("IDSW", "Frag", "false_tracks")
_SPREAD_HEADINGS = ("set", "tracker", "frames", "runs", "MODA", "IDF1", "MOTA", "switches")
_SIDE_HEADINGS = (
    *("set", "frames", "variant", "MODA", "IDF1", "MOTA", "switches", "error m", "tracks", "ms, tracker", "ms, all"),
)
_PEER_HEADINGS = (
    *("frames", "method", "MODA", "precision", "recall", "error m", "IDF1", "MOTA", "switches", "ms/frame"),
)


def page(figures: Figures) -> str:
    """The whole page."""
    commits = sorted({row["commit"] for row in figures.values() if "commit" in row})
    return _PAGE.format(
        commits=f"Commit {', '.join(commits)}." if commits else "",
        table=_table(figures),
        spread=_spread(figures),
        trackers=_side_by_side(figures),
        peers=_peers(figures),
        commands=_commands(figures),
    )


def _rows(figures: Figures, variants: Iterable[Variant]) -> Iterator[tuple[ResultSet, Variant, Mapping[str, Any]]]:
    for one, variant in product(SETS.values(), variants):
        if f"{one.name} {variant.name}" in figures:
            yield one, variant, figures[f"{one.name} {variant.name}"]


def _table(figures: Figures) -> str:
    lines = _head(_HEADINGS, 2)
    for one, variant, row in _rows(figures, MAIN):
        time = _milliseconds(row)
        speed = "-" if time is None else f"{1000 / time:.1f}"
        shown = [one.name, variant.words, *_scores(row, _PERCENT, _COUNTS), str(row["tracks"]), _error(row), speed]
        lines.append(_line([*shown, _measured_on(one, row)]))
    return "\n".join(lines)


def _spread(figures: Figures) -> str:
    lines = _head(_SPREAD_HEADINGS, 3)
    for one, variant, row in _rows(figures, MAIN):
        if "perturbed" in row:
            found = row["perturbed"]
            cells = [f"{found[name][0]:.1f} ± {found[name][1]:.1f}" for name in ("MODA", "IDF1", "MOTA", "IDSW")]
            lines.append(_line([one.name, variant.words, row["frames"], str(found["runs"]), *cells]))
    return "\n".join(lines)


def _side_by_side(figures: Figures) -> str:
    lines = _head(_SIDE_HEADINGS, 3)
    for one, variant, row in _rows(figures, VARIANTS.values()):
        scores = _scores(row, ("MODA", "IDF1", "MOTA"), ("IDSW",))
        times = (row["milliseconds"].get("track"), _milliseconds(row))
        shown = [one.name, row["frames"], variant.words, *scores, _error(row), str(row["tracks"])]
        lines.append(_line([*shown, *(_number(time, 1) for time in times)]))
    return "\n".join(lines)


def _scores(row: Mapping[str, Any], percent: Sequence[str], counts: Sequence[str]) -> list[str]:
    """Cells of a row's scores; dashes where there is no truth."""
    if "scores" not in row:
        return ["-"] * (len(percent) + len(counts))
    scores = row["scores"]
    return [_number(scores[name], 1) for name in percent] + [str(scores[name]) for name in counts]


def _error(row: Mapping[str, Any]) -> str:
    return _number(row["scores"]["location_error_m"]["mean"], 3) if "scores" in row else "-"


def _milliseconds(row: Mapping[str, Any]) -> float | None:
    """All stages, a frame; None where nothing was timed."""
    return float(sum(row["milliseconds"].values())) or None


def _measured_on(one: ResultSet, row: Mapping[str, Any]) -> str:
    gate = [] if "scores" not in row else [f"gate {row['scores']['gate_m']:g} m"]
    tracked = [] if "scores" in row else [f"{row['people_a_frame']:.1f} people a frame"]
    views = f"{one.views} views"
    return "; ".join([one.foreground, views, f"frames {row['frames']}", *gate, one.area, one.remark, *tracked])


def _peers(figures: Figures) -> str:
    lines = _head(_PEER_HEADINGS, 2)
    for name, peers in PEERS.items():
        one = SETS[name]
        taken = f"{name} {one.peer_frames or one.frames}"
        lines += [_line([taken, *_peer_cells(peer)]) for peer in peers]
        lines += [_line([taken, *_own_cells(variant, row)]) for own, variant, row in _rows(figures, MAIN) if own is one]
    return "\n".join(lines)


def _peer_cells(peer: Peer) -> list[str]:
    figures = (peer.moda, peer.precision, peer.recall)
    later = [_number(peer.idf1, 1), _number(peer.mota, 1), str(peer.switches), _number(peer.milliseconds, 0)]
    return [peer.method, *(_number(figure, 1) for figure in figures), _number(peer.location_error, 3), *later]


def _own_cells(variant: Variant, row: Mapping[str, Any]) -> list[str]:
    scores = row.get("peer_scores", row["scores"])
    found = [f"**{_number(scores[name], 1)}**" for name in ("MODA", "precision", "recall")]
    error = f"**{_number(scores['location_error_m']['mean'], 3)}**"
    known = [f"**{_number(scores[name], 1)}**" for name in ("IDF1", "MOTA")]
    time = _number(_milliseconds(row), 0)
    return [f"**stseg, {variant.words}**", *found, error, *known, f"**{scores['IDSW']}**", f"**{time}**"]


def _commands(figures: Figures) -> str:
    blocks = []
    for one, variant, row in _rows(figures, MAIN):
        prepared = variant.name == "frames" and f"{one.name} cut" in figures
        film = [] if one.film is None else [one.film]
        first = [] if prepared else [*film, *one.prepare]
        scored = [row["evaluate"]] if "evaluate" in row else []
        head = f"{one.name}, {variant.words}: stseg {row['version']}, {row['date']}"
        blocks.append("\n".join([f"# {head}", *first, row["run"], *scored]))
    return "```sh\n" + "\n\n".join(blocks) + "\n```"


def _head(headings: Sequence[str], texts: int) -> list[str]:
    right = len(headings) - texts - (headings[-1] == "measured on")
    return [_line(headings), _line((["---"] * texts + ["--:"] * right + ["---"])[: len(headings)])]


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _number(value: float | None, decimals: int) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"
