"""`stseg inspect`: what is in a run file, on one screen."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from stseg.io.runs import Run, read_run

_LONGEST = 10  # tracks on the screen


@dataclass(frozen=True)
class Overview:
    """The essentials of a run; seconds, metres, bytes, and frames with both ends included."""

    file: str
    scene: str
    cameras: tuple[str, ...]
    created: str
    x: tuple[float, float]
    y: tuple[float, float]
    top: float
    cell: float
    planes: int
    frame_rate: float
    frames: int
    first_frame: int | None
    last_frame: int | None
    seconds: float
    people_mean: float
    people_most: int
    tracks: list[dict[str, float]]
    events: dict[str, int]
    candidates_per_frame: float
    ghosts_per_frame: float
    windows: int
    frames_per_window: float
    rates: dict[str, dict[str, float]]
    seconds_by_stage: dict[str, float]
    bytes_per_frame: float
    bytes: int
    warnings: list[str]


def inspect(run: Path, /, *, as_json: Annotated[bool, Parameter(name="--json", negative="")] = False) -> None:
    """Say what is in a run file: extent, windows, tracks, events, timings.

    Example: stseg inspect night.h5

    Parameters
    ----------
    run
        The run file.
    as_json
        Print one JSON object, with every track.
    """
    overview = look_over(read_run(run))
    if as_json:
        print(json.dumps(asdict(overview), indent=1))
    else:
        _show(overview, Console(highlight=False, markup=False))


def look_over(run: Run) -> Overview:
    """Sum up a run."""
    count, size, grid = len(run.frames), run.path.stat().st_size, run.recording.rig.grid
    people = np.unique(run.trajectory["frame"], return_counts=True)[1]
    ghosts = run.ghosts["status"] == 0
    solved = run.windows["solve_stop"] - run.windows["solve_first"]
    return Overview(
        file=str(run.path),
        scene=run.scene,
        cameras=run.cameras,
        created=run.provenance.created,
        x=grid.x,
        y=grid.y,
        top=grid.top,
        cell=grid.cell,
        planes=grid.planes,
        frame_rate=run.frame_rate,
        frames=count,
        first_frame=int(run.frames[0]) if count else None,
        last_frame=int(run.frames[-1]) if count else None,
        seconds=count / run.frame_rate,
        people_mean=_per(people.sum(), count),
        people_most=int(people.max(initial=0)),
        tracks=_tracks(run),
        events=_counts(run.events["kind"]),
        candidates_per_frame=_per(len(ghosts), count),
        ghosts_per_frame=_per(ghosts.sum(), count),
        windows=len(solved),
        frames_per_window=_per(solved.sum(), len(solved)),
        rates=_rates(run),
        seconds_by_stage=_seconds_by_stage(run),
        bytes_per_frame=_per(size, count),
        bytes=size,
        warnings=_warnings(run),
    )


def _per(total: float, count: int) -> float:
    return float(total) / count if count else 0.0


def _tracks(run: Run) -> list[dict[str, float]]:
    """Every track, the longest first."""
    rows = run.tracks[np.lexsort((run.tracks["id"], -run.tracks["frames"]))]
    return [dict(zip(rows.dtype.names or (), row.tolist(), strict=True)) for row in rows]


def _counts(kinds: np.ndarray[tuple[int, ...], np.dtype[np.bytes_]]) -> dict[str, int]:
    names, counts = np.unique(kinds, return_counts=True)
    return {name.decode(): int(number) for name, number in zip(names.tolist(), counts, strict=True)}


def _rates(run: Run) -> dict[str, dict[str, float]]:
    """How each view errs by the end of the run."""
    last = run.rates[run.rates["frame"] == run.rates["frame"].max(initial=-1)]
    return {
        run.cameras[row["view"]]: {name: float(row[name]) for name in ("miss", "clutter", "beside")} for row in last
    }


def _seconds_by_stage(run: Run) -> dict[str, float]:
    """The slowest stage first."""
    names, stage = np.unique(run.timings["stage"], return_inverse=True)
    seconds = np.bincount(stage, run.timings["seconds"], len(names))
    return {names[index].decode(): float(seconds[index]) for index in np.argsort(-seconds, kind="stable")}


def _warnings(run: Run) -> list[str]:
    if not len(run.frames):
        return ["there are no frames"]
    warnings = [] if len(run.tracks) else ["nobody was found"]
    if not run.views.any():
        warnings.append("no view sees any cell")
    if len(run.ghosts):
        silent = (np.nan_to_num(run.ghosts["parts"]) == 0).all(axis=0)
        warnings += [
            f"view {name} says nothing of any candidate: is it blind, or its calibration wrong?"
            for name, is_silent in zip(run.cameras, silent, strict=True)
            if is_silent
        ]
    return warnings


def _show(overview: Overview, console: Console) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0), title=overview.file, title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for name, text in _lines(overview):
        table.add_row(name, text)
    console.print(table)
    if overview.tracks:
        console.print(_longest(overview))
    for warning in overview.warnings:
        console.print(f"warning: {warning}", style="yellow")


def _lines(overview: Overview) -> list[tuple[str, str]]:
    o = overview
    total = sum(o.seconds_by_stage.values())
    stages = (f"{name} {_share(seconds, total)}" for name, seconds in o.seconds_by_stage.items())
    span = "" if o.first_frame is None else f", {o.first_frame} to {o.last_frame}"
    return [
        ("scene", f"{o.scene}: {len(o.cameras)} cameras ({', '.join(o.cameras)}), run of {o.created}"),
        ("ground", f"x {o.x[0]:g} to {o.x[1]:g} m, y {o.y[0]:g} to {o.y[1]:g} m, cells of {o.cell:g} m"),
        ("planes", f"{o.planes} up to {o.top:g} m"),
        ("frames", f"{o.frames}{span}; {o.seconds:.1f} s at {o.frame_rate:g} frames/s"),
        ("people", f"{o.people_mean:.1f} a frame, at most {o.people_most}; {len(o.tracks)} tracks"),
        ("events", ", ".join(f"{count} {kind}" for kind, count in o.events.items()) or "none"),
        ("candidates", f"{o.candidates_per_frame:.1f} a frame, {o.ghosts_per_frame:.1f} of them ghosts"),
        ("rates", _errors(o.rates)),
        ("windows", f"{o.windows}, {o.frames_per_window:.1f} frames each"),
        ("time", f"{total:.1f} s" + (f", {_per(o.frames, 1) / total:.1f} frames/s" if total else "")),
        ("stages", ", ".join(stages) or "none"),
        ("size", f"{o.bytes / 1e6:.1f} MB, {o.bytes_per_frame / 1e3:.1f} kB a frame"),
    ]


def _errors(rates: dict[str, dict[str, float]]) -> str:
    """Bodies missed, and empty rays that meet foreground far from people and beside them, view by view, %."""
    each = (
        f"{name} {100 * r['miss']:.0f}/{100 * r['clutter']:.1f}/{100 * r['beside']:.0f}" for name, r in rates.items()
    )
    return "% missed/clutter/beside people: " + ", ".join(each) if rates else "none"


def _share(seconds: float, total: float) -> str:
    return f"{seconds:.1f} s ({100 * seconds / total:.0f} %)" if total else f"{seconds:.1f} s"


def _longest(overview: Overview) -> Table:
    shown = overview.tracks[:_LONGEST]
    title = f"the {len(shown)} longest of {len(overview.tracks)} tracks"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    for heading in ("id", "frames", "first", "last", "seconds", "height m", "score"):
        table.add_column(heading, justify="right")
    for track in shown:
        seconds = f"{track['frames'] / overview.frame_rate:.1f}"
        numbers = (f"{track[name]:.0f}" for name in ("id", "frames", "first", "last"))
        table.add_row(*numbers, seconds, f"{track['height']:.2f}", f"{track['score']:.1f}")
    return table
