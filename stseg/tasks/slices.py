"""`stseg inspect --slice`: one plane of one frame of a run file as a picture."""

from pathlib import Path

import numpy as np

from stseg.arrays import Floats
from stseg.errors import ConfigError
from stseg.io.outputs.whole_files import Inputs, marked_png, require_output, write_file
from stseg.io.runfile.runs import Run
from stseg.reporting.page.html import png_bytes
from stseg.reporting.pictures.slices import marginal_picture, plane_picture

_EXPECTED = "t=SECONDS or frame=NUMBER, and plane=METRES or plane=all"
_WIDTH = 1000  # pixels


def write_slice(run: Run, text: str, output: Path, overwrite: bool) -> str:
    """Write the picture of a slice; returns its description.

    Parameters
    ----------
    text
        For example t=12.4,plane=0.9 or frame=62,plane=all.
    output
        The PNG file.
    overwrite
        Whether an older file may be replaced.

    Raises
    ------
    ConfigError
        Where the text is not of that form, or the run has no such frame or plane.
    OutputError
    """
    require_output(output, overwrite, Inputs(run.files))
    if run.kept == "none":
        raise ConfigError("command line", "--slice", "a run that keeps no volume", "one made without --volume none")
    wanted = _parse(text)
    frame = _frame(run, wanted, text)
    grid, (log_odds, label) = run.recording.rig.grid, run.read_frame(frame)
    title = f"{run.scene}  frame {frame}, {frame / run.frame_rate:.2f} s"
    if wanted["plane"] == "all":
        picture, where = marginal_picture(log_odds, label, grid, title, _WIDTH), "the greatest of all planes"
    else:
        plane = _plane(run.heights, wanted["plane"])
        picture, where = plane_picture(log_odds, label, grid, plane, title, _WIDTH), f"{run.heights[plane]:.2f} m"
    write_file(output, marked_png(png_bytes(picture)), overwrite)
    return f"frame {frame} ({frame / run.frame_rate:.2f} s), {where}"


def _parse(text: str) -> dict[str, str]:
    parts = [part.partition("=") for part in text.split(",")]
    wanted = {key.strip(): value.strip() for key, _, value in parts}
    if set(wanted) not in ({"t", "plane"}, {"frame", "plane"}) or len(parts) != 2:
        raise ConfigError("command line", "--slice", repr(text), _EXPECTED)
    return wanted


def _number(key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise ConfigError("command line", f"--slice {key}", repr(text), "a number") from error


def _frame(run: Run, wanted: dict[str, str], text: str) -> int:
    if not len(run.frames):
        raise ConfigError("command line", "--slice", repr(text), "a run with frames: this one is empty")
    first, last = int(run.frames[0]), int(run.frames[-1])
    if "frame" in wanted:
        requested = _number("frame", wanted["frame"])
        if requested not in run.frames:
            expected = f"a frame of the run, {first} to {last}"
            raise ConfigError("command line", "--slice frame", wanted["frame"], expected)
        return int(requested)
    requested = _number("t", wanted["t"]) * run.frame_rate
    nearest = int(run.frames[np.abs(run.frames - requested).argmin()]) if np.isfinite(requested) else first
    if not abs(nearest - requested) <= 0.5 + 1e-6:
        span = f"seconds of the run, {first / run.frame_rate:g} to {last / run.frame_rate:g}"
        raise ConfigError("command line", "--slice t", wanted["t"], span)
    return nearest


def _plane(heights: Floats, text: str) -> int:
    requested = _number("plane", text)
    step = float(np.diff(heights).max(initial=0.0))
    nearest = int(np.abs(heights - requested).argmin()) if np.isfinite(requested) else 0
    if not abs(heights[nearest] - requested) <= step / 2 + 1e-6:
        raise ConfigError("command line", "--slice plane", text, f"a height in metres, 0 to {heights[-1]:g}, or all")
    return nearest
