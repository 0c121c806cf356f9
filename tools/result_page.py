"""The generated parts of docs/results.md: the table, the trackers side by side, the peers, the commands."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from result_peers import PEERS, Peer
from result_sets import SETS, ResultSet
from result_ways import WAYS, Way

Figures = Mapping[str, Mapping[str, Any]]
"""Rows of docs/results.json by `set way`."""

MAIN = (WAYS["cut"], WAYS["frames"])
"""The ways of the first table, of the peers and of the commands."""

_HEADINGS = (
    *("set", "tracker", "MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA", "switches", "fragments"),
    *("false tracks", "tracks", "error m", "frames/s", "measured on"),
)
_PERCENT = ("MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA")
_COUNTS = ("IDSW", "Frag", "false_tracks")
_SIDE_HEADINGS = (
    *("set", "frames", "way", "MODA", "IDF1", "MOTA", "switches", "error m", "tracks", "ms, tracker", "ms, all"),
)
_PEER_HEADINGS = (
    *("frames", "method", "MODA", "precision", "recall", "error m", "IDF1", "MOTA", "switches", "ms/frame"),
)


def rewrite(page: str, figures: Figures) -> str:
    """The page with its marked parts made anew; the text around them stays."""
    parts = {"table": _table, "trackers": _side_by_side, "peers": _peers, "commands": _commands}
    for name, written in parts.items():
        begin, end = f"<!-- {name}: begin, written by tools/results.py -->\n", f"<!-- {name}: end -->"
        if (page.count(begin), page.count(end)) != (1, 1):
            raise SystemExit(f"results.py: docs/results.md: found no single part marked {name!r}, expected one")
        before, _, rest = page.partition(begin)
        page = f"{before}{begin}{written(figures)}\n{end}{rest.partition(end)[2]}"
    return page


def _rows(figures: Figures, ways: Iterable[Way]) -> Iterator[tuple[ResultSet, Way, Mapping[str, Any]]]:
    for one, way in product(SETS.values(), ways):
        if f"{one.name} {way.name}" in figures:
            yield one, way, figures[f"{one.name} {way.name}"]


def _table(figures: Figures) -> str:
    lines = [_line(_HEADINGS), _line(["---"] * 2 + ["--:"] * 13 + ["---"])]
    for one, way, row in _rows(figures, MAIN):
        scores = _scores(row, _PERCENT, _COUNTS)
        shown = [one.name, way.words, *scores, str(row["tracks"]), _error(row), f"{1000 / _milliseconds(row):.1f}"]
        lines.append(_line([*shown, _measured_on(one, row)]))
    return "\n".join(lines)


def _side_by_side(figures: Figures) -> str:
    lines = [_line(_SIDE_HEADINGS), _line(["---"] * 3 + ["--:"] * 8)]
    for one, way, row in _rows(figures, WAYS.values()):
        scores = _scores(row, ("MODA", "IDF1", "MOTA"), ("IDSW",))
        times = (row["milliseconds"].get("track"), _milliseconds(row))
        shown = [one.name, row["frames"], way.words, *scores, _error(row), str(row["tracks"])]
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


def _milliseconds(row: Mapping[str, Any]) -> float:
    """The whole way, a frame."""
    return float(sum(row["milliseconds"].values()))


def _measured_on(one: ResultSet, row: Mapping[str, Any]) -> str:
    gate = [] if "scores" not in row else [f"gate {row['scores']['gate_m']:g} m"]
    tracked = [] if "scores" in row else [f"{row['people_a_frame']:.1f} people a frame"]
    views = f"{one.views} views"
    return "; ".join([one.foreground, views, f"frames {row['frames']}", *gate, one.area, one.remark, *tracked])


def _peers(figures: Figures) -> str:
    lines = [_line(_PEER_HEADINGS), _line(["---"] * 2 + ["--:"] * 8)]
    for name, peers in PEERS.items():
        one = SETS[name]
        taken = f"{name} {one.peer_frames or one.frames}"
        lines += [_line([taken, *_peer_cells(peer)]) for peer in peers]
        lines += [_line([taken, *_own_cells(way, row)]) for own, way, row in _rows(figures, MAIN) if own is one]
    return "\n".join(lines)


def _peer_cells(peer: Peer) -> list[str]:
    figures = (peer.moda, peer.precision, peer.recall)
    later = [_number(peer.idf1, 1), _number(peer.mota, 1), str(peer.switches), _number(peer.milliseconds, 0)]
    return [peer.method, *(_number(figure, 1) for figure in figures), _number(peer.location_error, 3), *later]


def _own_cells(way: Way, row: Mapping[str, Any]) -> list[str]:
    scores = row.get("peer_scores", row["scores"])
    found = [f"**{_number(scores[name], 1)}**" for name in ("MODA", "precision", "recall")]
    error = f"**{_number(scores['location_error_m']['mean'], 3)}**"
    known = [f"**{_number(scores[name], 1)}**" for name in ("IDF1", "MOTA")]
    time = _number(_milliseconds(row), 0)
    return [f"**stseg, {way.words}**", *found, error, *known, f"**{scores['IDSW']}**", f"**{time}**"]


def _commands(figures: Figures) -> str:
    blocks = []
    for one, way, row in _rows(figures, MAIN):
        first = [] if way.name == "frames" and f"{one.name} cut" in figures else [*_film(one), *one.prepare]
        scored = [row["evaluate"]] if "evaluate" in row else []
        head = f"{one.name}, {way.words}: stseg {row['version']}, {row['date']}"
        blocks.append("\n".join([f"# {head}", *first, row["run"], *scored]))
    return "```sh\n" + "\n\n".join(blocks) + "\n```"


def _film(one: ResultSet) -> list[str]:
    return [] if one.film is None else [one.film]


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _number(value: float | None, decimals: int) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"
