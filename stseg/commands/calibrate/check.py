"""`stseg calibrate check`: check a rig against its recording."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from stseg.commands.options import Frames, Overwrite
from stseg.commands.terminal.standard_error import TerminalReporter
from stseg.commands.terminal.standard_output import output_console, table_of
from stseg.engine.offline.frame_range import FrameRange
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.recording.rigs import read_recording
from stseg.io.recording.source_files import recording_files
from stseg.tasks.calibration.check import COLUMNS, READING, RigCheck, check_rig


def check(
    rig: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], metavar="CHECK.html")] = None,
    pictures: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    frames: Frames = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    overwrite: Overwrite = False,
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
    """
    if output is not None:
        require_output(output, overwrite, Inputs(recording_files(read_recording(rig))))
    found = check_rig(rig, frames=FrameRange.parsed(frames), progress=TerminalReporter())
    if as_json:
        print(json.dumps(found.as_dict(), indent=2))
    else:
        _print(found)
    contents = "with camera frames" if found.recording.has_camera_frames else "without camera frames"
    if output is not None:
        found.write_page(output, overwrite)
        print(f"wrote {output} ({contents})")
    if pictures is not None:
        count = found.write_pictures(pictures, overwrite)
        print(f"wrote {count} pictures to {pictures} ({contents})")


def _print(found: RigCheck) -> None:
    console = output_console()
    console.print(table_of(COLUMNS, found.rows()))
    console.print(READING, style="dim", soft_wrap=True)
    for sentence in found.verdict:
        console.print(sentence, style=None if found.sound else "yellow", soft_wrap=True)
