"""Temporal alignment of cameras: which frame of each camera shows which tick of the recording's clock.

Frame k of the recording is the scene k / frame_rate seconds after its start. By default a camera shows it in its own
frame k - offset. Where the time stamps of its files are trusted, it shows it in the frame taken nearest to that time,
and is blind where there is none near. Unless the rig decides (`clock`), stamps are trusted as follows:

1. Stamps within half a frame of the frame numbers: both agree, frames are counted.
2. Stamps that vary come from a clock and are trusted. (AVI has none, see `stseg.io.recording.video.time_stamps`.)
3. Stamps of another constant rate may come from a header. They are trusted where another camera keeps the rig's rate
   by rule 1 or 2, unless this camera has as many frames as that one: then its header is wrong.
4. Otherwise frames are counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stseg.arrays import Floats, Ints
from stseg.errors import SourceError
from stseg.io.recording.recording import CameraSource, Recording
from stseg.io.recording.source_files import source_parts
from stseg.io.recording.video.avi_index import lost_frames
from stseg.io.recording.video.time_stamps import (
    TimeStamps,
    concatenate_files,
    have_stamps,
    interpret_stamps,
    require_starts,
)

_JITTER = 0.5
"""Hysteresis, ticks: how much farther than the last frame a new one may lie and still replace it. Without it a camera
whose frames lie midway between ticks would repeat and skip frames at the slightest jitter."""
_COUNT_TOLERANCE = 0.01
"""Relative difference up to which two frame counts are equal."""
_RANGES = 5
"""Number of gaps that a message lists."""
_END_TOLERANCE = 1.0
"""Cameras aligned by time end together where their ends differ by no more than this, seconds."""


@dataclass(frozen=True)
class TimeAlignment:
    """Which frame of each camera shows which tick, for all cameras."""

    frame_at_tick: tuple[Ints | None, ...]
    """int64 (tick,) or None each: `CameraSource.frame_at_tick` of each camera."""
    notes: tuple[str, ...]
    """Messages for the user, one line each."""


@dataclass(frozen=True)
class _CameraTimes:
    """One camera's files: whether they have time stamps, the stamps, and frame positions by counting alone, ticks."""

    name: str
    source: CameraSource
    has_stamps: bool
    stamps: TimeStamps | None
    frames: int
    counted: Floats
    """Empty where neither stamps nor starts nor damage are compared with them."""
    damage: str
    """Frames that its files lost, as a message; empty where they are whole."""

    @property
    def regular(self) -> bool:
        """Whether its stamps agree with its frame numbers."""
        return self.stamps is not None and self.stamps.fits(self.counted)

    @property
    def keeps_rate(self) -> bool:
        """Whether its stamps come from a clock at the rig's rate."""
        return self.stamps is not None and (self.regular or not self.stamps.steady)


def align_in_time(recording: Recording, times: Sequence[Sequence[Floats]]) -> TimeAlignment:
    """Align the frames of all cameras by the time stamps of all frames of each of their files.

    Stamps float64 (n,) are in milliseconds, nan where there is none. SourceError where a camera's `clock` is "stamps"
    and it has none, or `starts` do not fit its files.
    """
    rate = recording.rig.frame_rate
    cameras = [
        _camera_times(camera.name, source, files, rate)
        for camera, source, files in zip(recording.rig.cameras, recording.sources, times, strict=True)
    ]
    notes: dict[str, list[str]] = {}
    frame_at_tick: list[Ints | None] = []
    for camera in cameras:
        trusted, note = _trusted_stamps(camera, [other for other in cameras if other is not camera], rate)
        if note:
            notes.setdefault(note, []).append(camera.name)
        if trusted is not None:
            frame_at_tick.append(nearest_frames(trusted.position, trusted.period))
            if missing := missing_images(frame_at_tick[-1]):
                notes.setdefault(missing, []).append(camera.name)
        else:
            by_place = camera.source.source.starts or camera.damage
            frame_at_tick.append(nearest_frames(camera.counted, 1.0) if by_place else None)
    lines = tuple(f"{', '.join(names)}: {note}" for note, names in notes.items())
    return TimeAlignment(_with_common_end(recording, cameras, frame_at_tick), lines)


def with_alignment(recording: Recording, frame_at_tick: Sequence[Ints | None]) -> Recording:
    """The recording with `frame_at_tick` set for each camera; unchanged where `frame_at_tick` is empty."""
    if not frame_at_tick:
        return recording
    pairs = zip(recording.sources, frame_at_tick, strict=True)
    return replace(recording, sources=tuple(replace(source, frame_at_tick=numbers) for source, numbers in pairs))


def nearest_frames(position: Floats, period: float) -> Ints:
    """For each tick the nearest frame, in non-decreasing order; -1 where none is near.

    Parameters
    ----------
    position : float64 (n,)
        Position of each frame, ticks, rising.
    period
        Usual distance of two frames, ticks. Frames of a slow camera are shown for several ticks.

    Returns
    -------
    int64 (tick,)
        Ticks 0 to the last tick at which the last frame is shown.
    """
    free = float(np.clip(1.0 - period / 2, 0.0, _JITTER))
    reach = (max(1.0, period) + free) / 2
    places = [*position.tolist(), np.inf, np.inf]
    frame_at_tick = np.full(int(np.ceil(places[-3] + period / 2 - 1e-9)), -1, np.int64)
    last, new = -1, 0
    for tick in range(len(frame_at_tick)):
        new = max(new, last + 1)
        while abs(places[new + 1] - tick) < abs(places[new] - tick):
            new += 1
        away, since = abs(places[new] - tick), abs(places[last] - tick) if last >= 0 else np.inf
        if away <= min(reach, since + free):
            frame_at_tick[tick] = last = new
        elif since <= reach:
            frame_at_tick[tick] = last
    return frame_at_tick


def visible_ranges(recording: Recording, counts: Sequence[int], length: int) -> list[Ints]:
    """The frames of a recording that each camera shows: half-open ranges, int64 (range, 2), rising.

    `counts` are the numbers of frames of the cameras, `length` that of the recording, which is aligned in time.
    """
    found = list[Ints]()
    for source, count in zip(recording.sources, counts, strict=True):
        edges = np.array([0, count])
        if source.frame_at_tick is not None:
            edges = np.flatnonzero(np.diff(np.concatenate([[-1], source.frame_at_tick, [-1]]) >= 0))
        ranges = np.clip(edges.reshape(-1, 2) + source.offset, 0, length)
        found.append(ranges[ranges[:, 0] < ranges[:, 1]])
    return found


def _camera_times(name: str, source: CameraSource, times: Sequence[Floats], rate: float) -> _CameraTimes:
    paths = [part.path for part in source_parts(source.timed, f"camera {name}")]
    require_starts(source.source.starts, len(paths), source.source.path, f"camera {name}, source.starts")
    starts = np.array(source.source.starts, float)
    lost = [lost_frames(path, len(stamps)) for path, stamps in zip(paths, times, strict=True)]
    damage = "; ".join(_damage(path, gone) for path, gone in zip(paths, lost, strict=True) if gone is None or len(gone))
    stamps = None if damage else interpret_stamps(times, rate, paths, starts)
    counted = np.zeros(0)
    if damage or stamps is not None or len(starts):
        numbers = [_numbers(len(one), gone) for one, gone in zip(times, lost, strict=True)]
        counted = concatenate_files(numbers, 1.0, rate, paths, starts)
    frames = sum(map(len, times))
    return _CameraTimes(name, source, have_stamps(times, paths), stamps, frames, counted, damage)


def _numbers(decoded: int, lost: Ints | None) -> Floats:
    """Numbers of the frames that were decoded, among all that there were."""
    if lost is None:
        return np.arange(float(decoded))
    return np.delete(np.arange(float(decoded + len(lost))), lost)


def _damage(path: Path, lost: Ints | None) -> str:
    if lost is None:
        return f"{path.name} is damaged, and its index does not say where: later frames are shown too early"
    return f"{path.name} is damaged: frames {_ranges(lost)} are lost, and the view is blind there"


def missing_images(frame_at_tick: Ints | None) -> str:
    """The frames that a camera lost, as a message; empty where it has all, or lost single ones."""
    gaps = _gaps(frame_at_tick)
    return f"no image of frames {_ranges(gaps)}: lost or damaged?" if len(gaps) else ""


def _gaps(frame_at_tick: Ints | None) -> Ints:
    """Ticks between the first and the last frame at which a camera shows none, two or more in a row.

    Single frames are dropped by many cameras now and then.
    """
    ticks = np.flatnonzero(np.zeros(0, bool) if frame_at_tick is None else frame_at_tick >= 0)
    steps = zip(ticks[:-1].tolist(), ticks[1:].tolist(), strict=True)
    return np.array([tick for a, b in steps if b - a > 2 for tick in range(a + 1, b)], np.int64)


def _ranges(numbers: Ints) -> str:
    """Rising numbers in words: the first ranges of them."""
    ends = np.flatnonzero(np.diff(numbers) > 1)
    firsts, lasts = numbers[np.append(0, ends + 1)].tolist(), numbers[np.append(ends, len(numbers) - 1)].tolist()
    words = [f"{first}" if first == last else f"{first} to {last}" for first, last in zip(firsts, lasts, strict=True)]
    more = f" and {len(words) - _RANGES} other places" if len(words) > _RANGES else ""
    return ", ".join(words[:_RANGES]) + more


def _trusted_stamps(camera: _CameraTimes, others: Sequence[_CameraTimes], rate: float) -> tuple[TimeStamps | None, str]:
    """The stamps that place a camera's frames, None where frames are counted; and a message for the user."""
    stamps, source = camera.stamps, camera.source
    if camera.damage or source.clock == "count":
        return None, camera.damage
    if stamps is None:
        if source.clock == "stamps":
            found = "files without time stamps that rise"
            raise SourceError(source.source.path, f"camera {camera.name}, clock", found, 'some, or clock = "count"')
        return (
            None,
            "the time stamps do not rise, or jump by a day; the frames are counted" if camera.has_stamps else "",
        )
    if camera.regular:
        return None, ""
    if source.clock == "stamps":
        return stamps, ""
    if not stamps.steady:
        return (stamps, 'the time stamps vary; each tick shows the nearest frame (clock = "count" would count)')
    rates = f"the time stamps say {stamps.rate * rate:.4g} frames per second, the rig {rate:.4g}"
    references = [other for other in others if other.keeps_rate or other.source.clock == "stamps"]
    if not references or _same_count(camera, stamps, references):
        return None, f'{rates}; the frames are counted (clock = "stamps" would go by the stamps)'
    return stamps, f'{rates}; each tick shows the nearest frame (clock = "count" would count)'


def _same_count(camera: _CameraTimes, stamps: TimeStamps, references: Sequence[_CameraTimes]) -> bool:
    """Whether a camera has as many frames as a reference at the rig's rate, but by its stamps another end."""
    count, by_time = camera.frames, stamps.position[-1] + stamps.period
    ends = [one.stamps.position[-1] + one.stamps.period if one.stamps else one.frames for one in references]
    return any(abs(count - end) <= _COUNT_TOLERANCE * end and abs(count - end) < abs(by_time - end) for end in ends)


def _with_common_end(
    recording: Recording, cameras: Sequence[_CameraTimes], frame_at_tick: Sequence[Ints | None]
) -> tuple[Ints | None, ...]:
    """Give required cameras that are aligned by time a common end, where their ends nearly agree.

    The end is that of counted cameras, else the latest of all; cameras that end earlier are blind until then.
    """
    required = [k for k, camera in enumerate(cameras) if camera.source.on_missing == "error"]
    counted = [cameras[k].source.offset + cameras[k].frames for k in required if frame_at_tick[k] is None]
    timed = {k: cameras[k].source.offset + len(numbers) for k in required if (numbers := frame_at_tick[k]) is not None}
    if not timed:
        return tuple(frame_at_tick)
    end, made = max(counted or timed.values()), list(frame_at_tick)
    for k, own_end in timed.items():
        numbers = frame_at_tick[k]
        if numbers is not None and abs(own_end - end) <= _END_TOLERANCE * recording.rig.frame_rate:
            made[k] = np.append(numbers, np.full(max(0, end - own_end), -1))[: len(numbers) + end - own_end]
    return tuple(made)
