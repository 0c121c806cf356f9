"""`stseg.check_rig`: a rig against its recording, by the people in it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path

from stseg.arrays import Floats, Observation
from stseg.calibration.check.blunders import find_swapped_streams
from stseg.calibration.check.box_correspondence import isolated_boxes
from stseg.calibration.check.rig_check import Check, swapped_text, verdict_text
from stseg.calibration.check.rig_check import check_rig as check_boxes
from stseg.calibration.check.verdict import Disagreement
from stseg.config import Config
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.offline.frame_range import FrameSpan
from stseg.engine.recordings import recording_of
from stseg.engine.reporter import AnyReporter, reporter_of
from stseg.errors import CalibrationError, ConfigError
from stseg.geometry.sampling import Sampling
from stseg.io.outputs.whole_files import Inputs, require_output, write_file
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.source_files import recording_files
from stseg.reporting.figures import Figure, backdrop
from stseg.reporting.page.html import figures, note, page, section, table
from stseg.reporting.pictures.maps import blind_map
from stseg.reporting.pictures.overlay import grid_picture
from stseg.tasks.report import write_figures

DEFAULT_FRAMES = 300
"""Frames that are read by default."""
COLUMNS = ("camera", "people", "shown %", "feet cm", "heads cm", "right cm", "down cm", "ground cm", "px")
"""Headings of `RigCheck.rows`."""
READING = (
    "feet, heads: off across the line of sight from where other views put them, root mean square; the larger decides, "
    "less the others' error. right, down: mean at the feet. ground, px: feet on the ground and in the image."
)
"""Explanation of the columns."""
_FIELDS = ("people", "confirmed", "feet", "heads", "right", "down", "ground", "pixels")


@dataclass(frozen=True)
class RigCheck:
    """Disagreements of each view of a rig with the others.

    Attributes
    ----------
    recording
        The rig and its streams.
    check
        Disagreements, swapped and delayed streams.
    verdict
        The same in sentences.
    frame
        The middle frame of those that were looked at.
    """

    recording: Recording
    check: Check
    verdict: tuple[str, ...]
    frame: int

    def __repr__(self) -> str:
        return f"RigCheck({self.recording.rig.name}: {' '.join(self.verdict)})"

    @property
    def sound(self) -> bool:
        """Whether no fault was found."""
        return self.check.sound

    def rows(self) -> list[list[str]]:
        """Disagreement of each view with the others in words, one row a camera, under `COLUMNS`."""
        rows = []
        views = zip(self.recording.rig.cameras, self.check.verdict.views, self.check.confirmed, strict=True)
        for camera, one, share in views:
            confirmed = "" if share != share else f"{100 * share:.0f}"
            rows.append([camera.name, *_numbers(one, confirmed)])
        return rows

    def as_dict(self) -> dict[str, object]:
        """The verdict in numbers, for JSON."""
        names, check = [camera.name for camera in self.recording.rig.cameras], self.check
        views = [None if one is None else {k: getattr(one, k) for k in _FIELDS} for one in check.verdict.views]
        return {
            "sound": check.sound,
            "words": list(self.verdict),
            "off": [names[one.view] for one in check.verdict.named],
            "swapped": [[names[view] for view in pair] for pair in check.swapped],
            "late": {names[one.view]: one.frames for one in check.delays},
            "people": check.people,
            "views": dict(zip(names, views, strict=True)),
        }

    @cached_property
    def views(self) -> tuple[Observation, ...]:
        """Each camera's observation of the middle frame, read on its first use."""
        with open_frames(self.recording.without_images(), self.frame, self.frame + 1) as frame_sets:
            return next(frame_sets).views

    @cached_property
    def pictures(self) -> list[Figure]:
        """Each camera's frame with the ground's grid and upright poles; last, how many views see the ground."""
        rig, views = self.recording.rig, zip(self.recording.rig.cameras, self.views, strict=True)
        grids = [
            Figure(
                f"grid_{camera.name}",
                grid_picture(camera, rig.grid, backdrop(view, camera.size), self.frame),
                camera.name,
            )
            for camera, view in views
        ]
        words = "How many views see each ground cell at some height."
        return [*grids, Figure("coverage", blind_map(rig, Sampling.of(rig, "point").views()), words)]

    def write_page(self, output: Path, overwrite: bool = False) -> None:
        """Write verdict and pictures as one HTML page, which holds images of the cameras."""
        require_output(output, overwrite, Inputs(recording_files(self.recording)))
        write_file(output, _page(self).encode(), overwrite)

    def write_pictures(self, folder: Path, overwrite: bool = False) -> int:
        """Write the pictures as PNG files grid_CAMERA.png and coverage.png; their number."""
        return len(write_figures(folder, self.pictures, overwrite, Inputs(recording_files(self.recording))))


def check_rig(rig: Path | str | Recording, *, frames: FrameSpan = None, progress: AnyReporter = None) -> RigCheck:
    """Check each view of a rig against the others by the people in its recording, as `stseg calibrate check` does.

    Parameters
    ----------
    rig
        The rig file, or a recording.
    frames
        (first, stop), half open; None for the first 300 frames.
    progress
        As of `stseg.track`.

    Raises
    ------
    InputError
        Where the recording cannot be read, or has no such frames.
    """
    recording, (first, stop) = recording_of(rig), _frame_range(frames)
    boxes = _isolated_boxes(recording, first, stop, progress)
    if not boxes:
        raise ConfigError("--frames", "", f"{first}:{stop}", "a part of the recording")
    if len(recording.rig.cameras) < 2:
        raise CalibrationError(recording.path, "camera", "one camera", "two or more, each to be checked by the others")
    check = check_boxes(recording.rig, boxes)
    judged = check.swapped or (check.sound and None not in check.verdict.views)
    for bare in () if judged else without_empty_scenes(recording):
        again = check_boxes(recording.rig, _isolated_boxes(bare, first, stop, progress))
        check = again if again.swapped else check
    return RigCheck(recording, check, tuple(verdict_text(recording.rig, check)), first + len(boxes) // 2)


def swap_warning(recording: Recording, first: int, stop: int) -> str:
    """The sentence on cameras with swapped streams, by the people in some frames; empty if no two are swapped."""
    coarse = recording.reduced(Config().foreground.body_rows)
    coarse = replace(coarse, reduction=(min(coarse.factors),) * len(coarse.factors))  # swapped streams have one scale
    boxes = _isolated_boxes(coarse, first, stop, None)
    swapped = find_swapped_streams(coarse.reduced_rig, boxes) if boxes else ()
    return swapped_text(recording.rig, swapped) if swapped else ""


def without_empty_scenes(recording: Recording) -> list[Recording]:
    """The streams alone, if there are empty scenes: those not swapped with their streams spoil the foreground."""
    bare = replace(recording, sources=tuple(replace(feed, background=None) for feed in recording.sources))
    return [] if bare == recording else [bare]


def _isolated_boxes(recording: Recording, first: int, stop: int, progress: AnyReporter) -> dict[int, list[Floats]]:
    """Boxes (n, 4) of people alone in each view by frame, pixels of the pictures as read; empty where no frame is."""
    with open_frames(recording.without_images(), first) as frame_sets:
        if next(frame_sets, None) is None:
            return {}
    foregrounds = make_foregrounds(recording, Config(), first, stop)
    sizes = [camera.size for camera in recording.reduced_rig.cameras]
    boxes: dict[int, list[Floats]] = {}
    with (
        open_frames(recording.without_images(), first, None) as frame_sets,
        reporter_of(progress).progress("looking", stop - first) as advance,
    ):
        for _, frame_set in zip(range(first, stop), frame_sets, strict=False):
            evidence = [
                foreground.evidence(view) for foreground, view in zip(foregrounds, frame_set.views, strict=True)
            ]
            boxes[frame_set.frame] = [isolated_boxes(one, size) for one, size in zip(evidence, sizes, strict=True)]
            advance(1)
    return boxes


def _frame_range(frames: FrameSpan) -> tuple[int, int]:
    begin, end = frames or (None, None)
    first = begin or 0
    stop = first + DEFAULT_FRAMES if end is None else end
    if stop <= first:
        raise ConfigError("--frames", "", f"'{first}:{stop}'", "A:B with A before B")
    return first, stop


def _numbers(one: Disagreement | None, confirmed: str) -> Sequence[str]:
    if one is None:
        return ["few", confirmed, *[""] * 6]
    metres = (one.feet, one.heads, one.right, one.down, one.ground)
    return [str(one.people), confirmed, *(f"{100 * value:.1f}" for value in metres), f"{one.pixels:.1f}"]


def _page(found: RigCheck) -> str:
    *grids, seen_by = found.pictures
    verdict = section("Verdict", *(note(escape(sentence)) for sentence in found.verdict))
    rows = [[escape(cell) for cell in row] for row in found.rows()]
    numbers = section("Views", table(COLUMNS, rows, len(rows)), note(READING))
    holds = [note("These pictures hold frames of the cameras.")] if found.recording.has_camera_frames else []
    views = section("Ground and poles", figures(grids, "pair"), *holds)
    ground = section("Coverage", figures([seen_by], "pair"))
    title = f"{found.recording.rig.name}: check of the rig"
    main = f"<main>{verdict}{numbers}{views}{ground}</main>"
    return page(title, f"<header><h1>{escape(title)}</h1></header>{main}", "{}", ())
