"""The generated parts of docs/results.md: the table, the peers, the commands."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from result_peers import PEERS, Peer
from result_sets import SETS, ResultSet

Figures = Mapping[str, Mapping[str, Any]]
"""Rows of docs/results.json by `set tracker`."""

_HEADINGS = (
    *("set", "tracker", "MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA", "switches", "fragments"),
    *("false tracks", "tracks", "error m", "frames/s", "measured on"),
)
_PERCENT = ("MODA", "MODP", "precision", "recall", "MOTA", "IDF1", "HOTA")
_COUNTS = ("IDSW", "Frag", "false_tracks")
_PEER_HEADINGS = (
    *("frames", "method", "MODA", "precision", "recall", "error m", "IDF1", "MOTA", "switches", "ms/frame"),
)


def rewrite(page: str, figures: Figures) -> str:
    """The page with its marked parts made anew; the text around them stays."""
    for name, text in (("table", _table(figures)), ("peers", _peers(figures)), ("commands", _commands(figures))):
        begin, end = f"<!-- {name}: begin, written by tools/results.py -->\n", f"<!-- {name}: end -->"
        if (page.count(begin), page.count(end)) != (1, 1):
            raise SystemExit(f"results.py: docs/results.md: found no single part marked {name!r}, expected one")
        before, _, rest = page.partition(begin)
        page = f"{before}{begin}{text}\n{end}{rest.partition(end)[2]}"
    return page


def _rows(figures: Figures) -> Iterator[tuple[ResultSet, Mapping[str, Any]]]:
    for one in SETS.values():
        for tracker in ("cut", "frames"):
            if f"{one.name} {tracker}" in figures:
                yield one, figures[f"{one.name} {tracker}"]


def _table(figures: Figures) -> str:
    lines = [_line(_HEADINGS), _line(["---"] * 2 + ["--:"] * 13 + ["---"])]
    for one, row in _rows(figures):
        scores = row.get("scores")
        cells = [one.name, row["tracker"]]
        if scores is None:
            cells += ["-"] * 10
        else:
            cells += [_number(scores[name], 1) for name in _PERCENT] + [str(scores[name]) for name in _COUNTS]
        error = None if scores is None else scores["location_error_m"]["mean"]
        cells += [str(row["tracks"]), _number(error, 3), f"{row['frames_per_second']:.1f}"]
        lines.append(_line([*cells, _measured_on(one, row)]))
    return "\n".join(lines)


def _measured_on(one: ResultSet, row: Mapping[str, Any]) -> str:
    gate = [] if "scores" not in row else [f"gate {row['scores']['gate_m']:g} m"]
    tracked = [] if "scores" in row else [f"{row['people_a_frame']:.1f} people a frame"]
    views = f"{one.views} views"
    return "; ".join([one.foreground, views, f"frames {one.frames}", *gate, one.area, one.remark, *tracked])


def _peers(figures: Figures) -> str:
    lines = [_line(_PEER_HEADINGS), _line(["---"] * 2 + ["--:"] * 8)]
    for name, peers in PEERS.items():
        one = SETS[name]
        taken = f"{name} {one.peer_frames or one.frames}"
        lines += [_line([taken, *_peer_cells(peer)]) for peer in peers]
        lines += [_line([taken, *_own_cells(row)]) for own, row in _rows(figures) if own is one]
    return "\n".join(lines)


def _peer_cells(peer: Peer) -> list[str]:
    figures = (peer.moda, peer.precision, peer.recall)
    later = [_number(peer.idf1, 1), _number(peer.mota, 1), str(peer.switches), _number(peer.milliseconds, 0)]
    return [peer.method, *(_number(figure, 1) for figure in figures), _number(peer.location_error, 3), *later]


def _own_cells(row: Mapping[str, Any]) -> list[str]:
    scores = row.get("peer_scores", row["scores"])
    found = [f"**{_number(scores[name], 1)}**" for name in ("MODA", "precision", "recall")]
    error = f"**{_number(scores['location_error_m']['mean'], 3)}**"
    known = [f"**{_number(scores[name], 1)}**" for name in ("IDF1", "MOTA")]
    time = _number(1000 / row["frames_per_second"], 0)
    return [f"**stseg, {row['tracker']}**", *found, error, *known, f"**{scores['IDSW']}**", f"**{time}**"]


def _commands(figures: Figures) -> str:
    blocks = []
    for one, row in _rows(figures):
        first = [] if row["tracker"] == "frames" and f"{one.name} cut" in figures else [*_film(one), *one.prepare]
        scored = [row["evaluate"]] if "evaluate" in row else []
        head = f"{one.name}, {row['tracker']}: stseg {row['version']}, {row['date']}"
        blocks.append("\n".join([f"# {head}", *first, row["run"], *scored]))
    return "```sh\n" + "\n\n".join(blocks) + "\n```"


def _film(one: ResultSet) -> list[str]:
    return [] if one.film is None else [one.film]


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _number(value: float | None, decimals: int) -> str:
    return "-" if value is None else f"{value:.{decimals}f}"
