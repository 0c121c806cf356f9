"""`stseg calibrate check`: check a rig against its recording."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from itertools import chain
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from stseg.arrays import Floats, Observation
from stseg.calibration.check.box_correspondence import isolated_boxes
from stseg.calibration.check.rig_check import Check, check_rig, coverage, verdict_text
from stseg.calibration.check.verdict import Disagreement
from stseg.engine.offline.backgrounds import make_foregrounds
from stseg.engine.offline.frame_range import FrameRange
from stseg.errors import ConfigError
from stseg.geometry import Rig
from stseg.io.config_file import read_config
from stseg.io.outputs.output_files import make_folder, write_file, write_page
from stseg.io.outputs.whole_files import require_new
from stseg.io.recording.frames import open_frames
from stseg.io.recording.recording import Recording
from stseg.io.recording.rigs import read_rig
from stseg.reporting.figures import Figure, backdrop
from stseg.reporting.page.html import figures, note, png_bytes, section, table
from stseg.reporting.page.style import STYLE
from stseg.reporting.pictures.ground_grid import grid_picture
from stseg.reporting.pictures.maps import blind_map

_FRAMES = 300
"""Default number of frames to read."""
_NAMES = ("camera", "people", "shown %", "feet cm", "heads cm", "right cm", "down cm", "ground cm", "px")


def check(
    rig: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], metavar="CHECK.html")] = None,
    pictures: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    frames: Annotated[str | None, Parameter(metavar="A:B")] = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Check each view of a rig against the others, by the people in the recording.

    Isolated people are matched between views by their boxes or foreground. Each view's feet and heads are compared with
    their predictions from the other views; the verdict says which camera is off and by how much, which streams are
    swapped, and which are delayed.

    The page (-o) and the pictures (--pictures) show each view's frame with the ground's grid and upright poles drawn
    on it, and how many views see the ground. **They hold camera pixels**: images of people, where the recording has
    them.

    Example: stseg calibrate check room.toml -o check.html

    Parameters
    ----------
    rig
        The rig file.
    output
        One HTML page with the verdict, the pictures and the coverage map.
    pictures
        A folder for the same pictures as PNG files: grid_CAMERA.png and coverage.png.
    frames
        Part of the recording to look at, half open; without it, its first 300 frames.
    as_json
        Print the verdict as JSON.
    overwrite
        Replace the page and the pictures if they exist.
    """
    if output is not None:
        require_new(output, overwrite)
    recording = read_rig(rig)
    first, stop = _part(frames)
    seen = _look(recording, first, stop)
    found = check_rig(recording.rig, seen.shown)
    words = verdict_text(recording.rig, found)
    if as_json:
        print(json.dumps(_as_json(recording.rig, found, words), indent=2))
    else:
        _print(recording.rig, found, words)
    if output is not None or pictures is not None:
        _write(recording, seen, found, words, output, pictures, overwrite)


@dataclass(frozen=True)
class _Seen:
    """Boxes of all frames, and what the cameras delivered at the middle one."""

    shown: dict[int, list[Floats]]
    frame: int
    views: tuple[Observation, ...]


def _part(text: str | None) -> tuple[int, int]:
    if text is None:
        return 0, _FRAMES
    given = FrameRange.parse(text)
    first = given.first or 0
    stop = first + _FRAMES if given.stop is None else given.stop
    if stop <= first:
        raise ConfigError("--frames", "", repr(text), "A:B with A before B")
    return first, stop


def _look(recording: Recording, first: int, stop: int) -> _Seen:
    foregrounds = make_foregrounds(recording, read_config(None, ()), first, stop)
    shown: dict[int, list[Floats]] = {}
    kept: tuple[int, tuple[Observation, ...]] = (first, (None,) * len(foregrounds))
    console = Console(stderr=True)
    with open_frames(recording.without_images(), first, None) as frame_sets:
        steps: Iterator[int] = iter(
            track(range(first, stop), "looking", console=console, disable=not console.is_terminal, transient=True)
        )
        for frame_set, _ in zip(frame_sets, steps, strict=False):
            evidence = [
                foreground.evidence(view) for foreground, view in zip(foregrounds, frame_set.views, strict=True)
            ]
            sizes = [camera.size for camera in recording.rig.cameras]
            shown[frame_set.frame] = [isolated_boxes(one, size) for one, size in zip(evidence, sizes, strict=True)]
            if frame_set.frame <= first + (stop - first) // 2:
                kept = (frame_set.frame, frame_set.views)
    if not shown:
        raise ConfigError("--frames", "", f"{first}:{stop}", "a part of the recording")
    return _Seen(shown, *kept)


def _print(rig: Rig, found: Check, words: Sequence[str]) -> None:
    console = Console(highlight=False, markup=False)
    shown = Table(box=None, padding=(0, 2, 0, 0))
    for name in _NAMES:
        shown.add_column(name, justify="left" if name == "camera" else "right")
    for row in _rows(rig, found):
        shown.add_row(*row)
    console.print(shown)
    for sentence in words:
        console.print(sentence, style=None if found.sound else "yellow", soft_wrap=True)


def _rows(rig: Rig, found: Check) -> list[list[str]]:
    """Disagreement of each view with the others."""
    rows = []
    for camera, one, share in zip(rig.cameras, found.verdict.views, found.confirmed, strict=True):
        shown = "" if share != share else f"{100 * share:.0f}"
        rows.append([camera.name, *_numbers(one, shown)])
    return rows


def _numbers(one: Disagreement | None, shown: str) -> list[str]:
    if one is None:
        return ["few", shown, *[""] * 6]
    metres = (one.feet, one.heads, one.right, one.down, one.ground)
    return [str(one.people), shown, *(f"{100 * value:.1f}" for value in metres), f"{one.pixels:.1f}"]


def _as_json(rig: Rig, found: Check, words: Sequence[str]) -> dict[str, object]:
    names = [camera.name for camera in rig.cameras]
    views = [None if one is None else {k: getattr(one, k) for k in _FIELDS} for one in found.verdict.views]
    return {
        "sound": found.sound,
        "words": list(words),
        "off": [names[one.view] for one in found.verdict.named],
        "swapped": [] if found.swapped is None else [names[view] for view in found.swapped],
        "late": {names[one.view]: one.frames for one in found.delays},
        "people": found.people,
        "views": dict(zip(names, views, strict=True)),
    }


_FIELDS = ("people", "confirmed", "feet", "heads", "right", "down", "ground", "pixels")


def _write(
    recording: Recording,
    seen: _Seen,
    found: Check,
    words: Sequence[str],
    output: Path | None,
    pictures: Path | None,
    overwrite: bool,
) -> None:
    rig = recording.rig
    grids = [
        Figure(
            f"grid_{camera.name}", grid_picture(camera, rig.grid, backdrop(view, camera.size), seen.frame), camera.name
        )
        for camera, view in zip(rig.cameras, seen.views, strict=True)
    ]
    seen_by = Figure("coverage", blind_map(rig, coverage(rig)), "How many views see each ground cell at some height.")
    if output is not None:
        write_page(output, _page(rig, found, words, grids, seen_by), overwrite)
        print(f"wrote {output} (it shows camera frames)")
    if pictures is not None:
        make_folder(pictures)
        for figure in chain(grids, [seen_by]):
            write_file(pictures / f"{figure.name}.png", png_bytes(figure.picture), overwrite)
        print(f"wrote {len(grids) + 1} pictures to {pictures} (they show camera frames)")


def _page(rig: Rig, found: Check, words: Sequence[str], grids: Sequence[Figure], seen_by: Figure) -> str:
    verdict = section("Verdict", *(note(escape(sentence)) for sentence in words))
    rows = [[escape(cell) for cell in row] for row in _rows(rig, found)]
    numbers = section(
        "Views",
        table(_NAMES, rows, len(rows)),
        note(
            "Off by so much, across the line of sight, from where the other views put feet and heads; root mean square."
        ),
    )
    views = section("Ground and poles", figures(grids, "pair"), note("These pictures hold frames of the cameras."))
    ground = section("Coverage", figures([seen_by], "pair"))
    title = escape(f"{rig.name}: check of the rig")
    head = f'<head><meta charset="utf-8"><title>{title}</title><style>{STYLE}</style></head>'
    main = f"<main>{verdict}{numbers}{views}{ground}</main>"
    return f'<!doctype html>\n<html lang="en">{head}\n<body><header><h1>{title}</h1></header>\n{main}</body></html>\n'
