"""Charts over time as inline SVG: number of people, and lifetimes of tracks."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from html import escape
from types import MappingProxyType

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.reporting.pictures.colours import hex_colour, track_colour
from stseg.reporting.run_statistics import DoubtfulStretch, Span

_WIDTH, _LEFT_MARGIN, _RIGHT_MARGIN = 1000, 44, 16  # pixels
_COLUMNS = 900  # steps of a chart, however long the recording
_LANE_HEIGHT, _MAX_LANES = 15, 60


def _column(span: Span, frame: float) -> float:
    """Pixels from the left."""
    return _LEFT_MARGIN + (frame - span.first) / (span.stop - span.first) * (_WIDTH - _LEFT_MARGIN - _RIGHT_MARGIN)


def people_chart(span: Span, trajectory: Rows, truth: Rows | None) -> str:
    """Number of people in each frame, and in the truth's frames; the mean where a pixel holds several frames."""
    height, bottom = 190, 158
    found = _counts(span, trajectory["frame"])
    true = None if truth is None else _true_counts(span, truth["frame"])
    most = max(1, int(found.max()), 0 if true is None else int(true.max()))
    rise = (bottom - 14) / most
    lines = [_open(height), *_clock(span, bottom, 14)]
    for count in range(0, most + 1, max(1, -(-most // 5))):
        v = bottom - count * rise
        lines.append(
            f'<line class="rule" x1="{_LEFT_MARGIN}" x2="{_WIDTH - _RIGHT_MARGIN}" y1="{v:.1f}" y2="{v:.1f}"/>'
        )
        lines.append(f'<text x="{_LEFT_MARGIN - 8}" y="{v + 4:.1f}" text-anchor="end">{count}</text>')
    steps = _steps(span, found, bottom, rise)
    lines.append(f'<path class="area" d="M{_LEFT_MARGIN},{bottom} {steps} V{bottom} Z"/>')
    lines.append(f'<path class="line" d="M{_LEFT_MARGIN},{bottom} {steps}"/>')
    if true is not None:
        lines.append(f'<path class="truth" d="M{_LEFT_MARGIN},{bottom} {_steps(span, true, bottom, rise)}"/>')
    return "\n".join([*lines, "</svg>"])


def track_chart(
    span: Span, tracks: Rows, doubtful: Sequence[DoubtfulStretch], names: Mapping[int, str] = MappingProxyType({})
) -> str:
    """A bar from each track's first frame to its last, with its name or id, pale where its points are doubtful.

    Bars are packed into lanes; beyond the last lane they are left out.
    """
    pale = defaultdict(list)
    for stretch in doubtful:
        pale[stretch.track].append(stretch)
    lanes = _lanes(tracks, max(1, (span.stop - span.first) // 150))
    count = min(max(lanes, default=0) + 1, _MAX_LANES)
    bottom = 8 + count * _LANE_HEIGHT + 4
    lines = [_open(bottom + 32), *_clock(span, bottom, 4)]
    for row, lane in zip(tracks, lanes, strict=True):
        if lane < _MAX_LANES:
            u, end = _column(span, int(row["first"])), _column(span, int(row["last"]) + 1)
            v, colour = 8 + lane * _LANE_HEIGHT, hex_colour(track_colour(int(row["id"])))
            name = names.get(int(row["id"]), str(row["id"]))
            words = f"track {escape(name)}: frames {row['first']} to {row['last']}"
            lines.append(
                f'<rect x="{u:.1f}" y="{v}" width="{max(end - u, 1.5):.1f}" height="{_LANE_HEIGHT - 4}" rx="3" '
                f'fill="{colour}"><title>{words}</title></rect>'
            )
            lines += [_pale(span, stretch, v) for stretch in pale[int(row["id"])]]
            if end - u > 8 * len(name) + 8:
                lines.append(f'<text class="on" x="{u + 5:.1f}" y="{v + _LANE_HEIGHT - 6}">{escape(name)}</text>')
    return "\n".join([*lines, "</svg>"])


def _pale(span: Span, stretch: DoubtfulStretch, v: int) -> str:
    """A veil over a doubtful part of a bar."""
    u, end = _column(span, stretch.first), _column(span, stretch.last + 1)
    words = f"track {stretch.track}, frames {stretch.first} to {stretch.last}: {100 * stretch.certainty:.0f} % certain"
    return (
        f'<rect class="pale" x="{u:.1f}" y="{v}" width="{max(end - u, 1.5):.1f}" height="{_LANE_HEIGHT - 4}">'
        f"<title>{words}</title></rect>"
    )


def _open(height: float) -> str:
    return f'<svg class="chart" viewBox="0 0 {_WIDTH} {height}" role="img">'


def _clock(span: Span, bottom: float, top: float) -> list[str]:
    """Marks of a round number of seconds, with faint upright lines."""
    seconds = (span.stop - span.first) / span.frame_rate
    step = _round_time(seconds / 8)
    lines = []
    start = span.first / span.frame_rate
    for second in np.arange(np.ceil(start / step) * step, start + seconds + 1e-9, step):
        u = _column(span, second * span.frame_rate)
        lines.append(f'<line class="rule" x1="{u:.1f}" x2="{u:.1f}" y1="{top}" y2="{bottom}"/>')
        lines.append(f'<text x="{u:.1f}" y="{bottom + 18}" text-anchor="middle">{clock_time(float(second))}</text>')
    return lines


def clock_time(second: float) -> str:
    """Time since the recording's first frame: 12 s, 3:05 or 2:03:05."""
    if second < 60:
        return f"{second:.3g} s"
    whole = round(second)
    hours, minutes, seconds = whole // 3600, whole // 60 % 60, whole % 60
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"


def _round_time(seconds: float) -> float:
    steps = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400)
    return min((float(step) for step in steps if step >= seconds), default=86400.0 * float(np.ceil(seconds / 86400)))


def _counts(span: Span, frames: Ints) -> Floats:
    """People in each frame, float64 (frame,)."""
    inside = frames[(frames >= span.first) & (frames < span.stop)] - span.first
    return np.bincount(inside, minlength=span.stop - span.first).astype(float)


def _true_counts(span: Span, frames: Ints) -> Floats:
    """The same of truth, which may be sparse: a frame without rows has the people of the last one with rows."""
    counts = _counts(span, frames)
    frames = np.flatnonzero(counts)
    if not len(frames):
        return counts
    last = np.searchsorted(frames, np.arange(len(counts)), "right") - 1
    return np.asarray(counts[frames[np.maximum(last, 0)]])


def _steps(span: Span, counts: Floats, bottom: float, rise: float) -> str:
    """A path of steps."""
    bounds = np.unique(np.linspace(0, len(counts), min(len(counts), _COLUMNS) + 1).astype(int))
    words = []
    for start, stop in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        v, end = bottom - counts[start:stop].mean() * rise, _column(span, span.first + stop)
        words.append(f"V{v:.1f} H{end:.1f}")
    return " ".join(words)


def _lanes(tracks: Rows, gap: int) -> list[int]:
    """The first lane that is free `gap` frames before each track, `tracks` being in any order."""
    ends: list[int] = []
    lanes = [0] * len(tracks)
    for k in np.lexsort((tracks["id"], tracks["first"])).tolist():
        first, last = int(tracks["first"][k]), int(tracks["last"][k])
        lane = next((lane for lane, end in enumerate(ends) if end + gap < first), len(ends))
        ends[lane : lane + 1] = [last]
        lanes[k] = lane
    return lanes
