"""Warnings about a finished run: views that are silent, moved, off or torn, and bodies other than configured."""

from collections.abc import Iterator, Sequence

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.errors import InputError
from stseg.io.config_file import parse_config
from stseg.io.recording.frames import read_camera
from stseg.io.recording.recording import Recording
from stseg.io.recording.time_alignment import missing_images
from stseg.io.runfile.runs import Run
from stseg.reporting.run_statistics import ground_by_views
from stseg.tasks.sources import body_height, recording_warnings, summarise_sources
from stseg.view_health.knock_detection import find_knocks, find_residual_step, views_off
from stseg.view_health.plausibility import scene_warnings, track_warnings
from stseg.view_health.run_warnings import body_warnings, view_warnings

_BLIND_SHARE = 0.05
"""Share of the ground that no view sees from which there is a warning."""
_CHECKED_FRAMES = 160
"""Frames by which swapped cameras are found where a view looks wrong."""
_DOUBTFUL_MISSES = 0.12
"""Miss rate from which they are looked for: swaps leave 0.13 to 0.8, right views 0.03 to 0.1, in crowds more."""
_UNLIKE = 1.4
"""Least ratio of that rate to the least one of all views or to the first guess: swaps leave 1.7 or more."""
_SAMPLED_FRAMES = slice(0, 1000, 50)
"""Frames of a run without people whose masks are looked at: an hour would have to be decoded."""
_BRIEF = 60.0
"""Length of a recording below which people who hardly move may hide the background, seconds."""
_MOVED = 1.0
"""Least shift of an image that counts as a moved camera, pixels."""


def run_warnings(run: Run, of_sources: Sequence[str] | None = None) -> list[str]:
    """One sentence for everything that a user should look at: `Run.warnings`, `stseg inspect`, the report.

    Those of the recording's sources are computed anew if they are not given.
    """
    if not len(run.frames):
        return ["there are no frames"]
    config = parse_config(run.provenance.config, f"{run.path}: the configuration")
    return [
        *_emptiness(run),
        *_brief_backgrounds(run),
        *explained_by_swap(
            run.recording,
            (int(run.frames[0]), int(run.frames[-1]) + 1),
            [
                *(source_warnings(run.recording) if of_sources is None else of_sources),
                *_missing_images(run.recording),
                *track_warnings(run.frame_rate, run.trajectory),
                *view_warnings(run.cameras, run.ghosts, run.frames, run.frame_rate),
                *body_warnings(run.cameras, run.trajectory, run.rates, config.body),
                *rig_warnings(run),
            ],
            _are_misses_doubtful(run, config.detection.pixel_miss_rate),
        ),
        *crowd_warnings(run.events),
    ]


def _emptiness(run: Run) -> Iterator[str]:
    """Nobody was found, or no view sees the ground."""
    if not len(run.tracks):
        dropped = int((run.events["kind"] == b"dropped").sum())
        remedy = "see /events, and tracking.minimum_duration for short recordings"
        yield f"all {dropped} tracks were dropped: {remedy}" if dropped else "no person was found"
        if not dropped and _have_faint_masks(run):
            yield "no mask has a value above 1: are they 0 and 1 instead of 0 and 255?"
    unseen = ground_by_views(run.views, run.recording.rig.grid.inside(), len(run.cameras))[0]
    if not run.views.any():
        yield "no view sees any cell"
    elif unseen > _BLIND_SHARE:
        yield f"no view sees {100 * unseen:.0f} % of the ground"


def _brief_backgrounds(run: Run) -> Iterator[str]:
    """Colour cameras without an empty scene, whose background few seconds showed."""
    seconds, sources = len(run.frames) / run.frame_rate, zip(run.cameras, run.recording.sources, strict=True)
    colour = [name for name, one in sources if one.source.kind in ("video", "images") and one.background is None]
    if colour and seconds < _BRIEF:
        yield (
            f"{', '.join(colour)}: the background was learned from {seconds:.0f} s: people who hardly moved may be "
            "part of it (background in the rig names an empty scene)"
        )


def _have_faint_masks(run: Run) -> bool:
    """Whether masks that still exist are 0 or 1 in the first frames of a run, and not all 0."""
    masks = [k for k, feed in enumerate(run.recording.sources) if feed.source.kind == "masks"]
    frames = run.frames[_SAMPLED_FRAMES].tolist()
    try:
        views = (view for k in masks for view in read_camera(run.recording, k, frames))
        greatest = max((float(view.max()) for view in views if isinstance(view, np.ndarray)), default=0.0)
    except InputError:
        return False
    return 0 < greatest <= 1


def _are_misses_doubtful(run: Run, guess: float) -> bool:
    """Whether a view by pixels misses much at the end of a run, and more than others; boxes are compared before it.

    In a crowd, and while the first guess prevails, all views miss alike.
    """
    last = run.rates[run.rates["frame"] == run.rates["frame"].max(initial=-1)]
    pixels = [one.source.kind != "boxes" for one in run.recording.sources]
    misses = [float(row["miss"]) for row in last if pixels[row["view"]]]
    return bool(misses) and max(misses) > max(_DOUBTFUL_MISSES, _UNLIKE * min(guess, *misses))


def explained_by_swap(
    recording: Recording, frames: tuple[int, int], warnings: list[str], is_doubtful: bool = False
) -> list[str]:
    """The warnings, or that of two swapped cameras, by the first of `frames` (first, stop) of sources that still exist.

    It is checked where a warning names a camera, or its misses are doubtful: a check takes seconds.
    """
    named = any(camera.name in warning for camera in recording.rig.cameras for warning in warnings)
    if not named and not is_doubtful:
        return warnings
    from stseg.tasks.calibration.check import swap_warning, without_empty_scenes  # other runs do without its libraries

    recordings, first = [recording, *(without_empty_scenes(recording) if named else [])], frames[0]
    try:
        swaps = (swap_warning(one, first, min(frames[1], first + _CHECKED_FRAMES)) for one in recordings)
        return next(([swap] for swap in swaps if swap), warnings)
    except InputError:
        return warnings


def source_warnings(recording: Recording) -> list[str]:
    """One sentence for each number of a rig or its boxes that is probably a mistake; none of sources that are gone."""
    try:
        return recording_warnings(recording, summarise_sources(recording))
    except InputError:
        return scene_warnings(recording.rig, body_height(recording))


def _missing_images(recording: Recording) -> list[str]:
    """One sentence for each camera that lost frames; gaps between files that `starts` places are no loss."""
    streams = zip(recording.rig.cameras, recording.sources, strict=True)
    found = [(view.name, missing_images(one.frame_at_tick)) for view, one in streams if not one.source.starts]
    return [f"{name}: {missing}" for name, missing in found if missing]


def rig_warnings(run: Run) -> list[str]:
    """Cameras that moved, by their images; else by their residuals; else views with a residual above one cell."""
    frames, residual = _residual_by_window(run)
    cell = run.recording.rig.grid.cell
    if moved := _moved(run):
        return moved
    if (knock := find_residual_step(residual, cell)) is not None:
        name, before, after = run.cameras[knock.view], _beside(knock.before), _beside(knock.after)
        return [
            f"view {name} was moved about frame {frames[knock.frame]}: it sees people {after} where the views put "
            f"them, {before} it before"
        ]
    if off := views_off(residual, cell):
        first, *others = (f"{run.cameras[one.view]} sees people {_beside(one.metres)}" for one in off)
        also = "".join(f", {other} it" for other in others)
        return [f"view {first} where the views put them{also}; see stseg calibrate check"]
    return []


def crowd_warnings(events: Rows) -> list[str]:
    """One sentence on frames whose search for people was not finished, by EVENT rows (n,)."""
    crowds = events[events["kind"] == b"crowd"]
    if not len(crowds):
        return []
    frame, reason = crowds["frame"][0], crowds["reason"][0].decode()
    return [f"the search for people was cut short in {len(crowds)} frames, first in frame {frame}: {reason}"]


def _moved(run: Run) -> list[str]:
    """One sentence for each colour view whose image moved by a pixel or more."""
    frames, sample = np.unique(run.shifts["frame"], return_inverse=True)
    shift = np.full((len(frames), len(run.cameras)), np.nan)
    shift[sample, run.shifts["view"]] = np.hypot(*(run.shifts[axis] for axis in "uv"))
    return [
        f"view {run.cameras[knock.view]} was moved about frame {frames[knock.frame]}: its picture by "
        f"{knock.before - knock.after:.0f} pixels"
        for knock in find_knocks(-shift, _MOVED)
    ]


def _residual_by_window(run: Run) -> tuple[Ints, Floats]:
    """Last frame of each window, and each view's mean reprojection residual in it (window, view), metres."""
    frames, window = np.unique(run.rates["frame"], return_inverse=True)
    residual = np.full((len(frames), len(run.cameras)), np.nan)
    residual[window, run.rates["view"]] = run.rates["residual"]
    return frames, residual


def _beside(metres: float) -> str:
    return f"{100 * abs(metres):.0f} cm to the {'right' if metres > 0 else 'left'} of"
