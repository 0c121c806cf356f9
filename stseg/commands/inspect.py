"""`stseg inspect`: the contents of a run file, or of a rig file's sources, on one screen."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from stseg.commands.options import Overwrite
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_output import output_console, table_of
from stseg.errors import ConfigError
from stseg.io.recording.rigs import read_recording
from stseg.io.runfile.runs import read_run
from stseg.records.tables import ERROR_RATES, event_word
from stseg.tasks.overview import Overview, summarise_run
from stseg.tasks.slices import write_slice
from stseg.tasks.sources import COLUMNS, recording_warnings, summarise_sources, write_source_pictures

_LONGEST = 8  # tracks on the screen
_MINUTES = 15  # of the run on the screen


def inspect(
    run: Path,
    /,
    *,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
    slice_: Annotated[str | None, Parameter(name="--slice", metavar="t=SECONDS,plane=METRES")] = None,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], metavar="SLICE.png")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Summarise a run file: extent, people, tracks, events, ghosts, timings and warnings; or the sources of a rig file.

    Example: stseg inspect night.h5

    Example: stseg inspect night.h5 --slice t=12.4,plane=0.9 -o slice.png

    Example: stseg inspect rig.toml -o pictures/

    Of a rig file it prints what each camera's source was recognised as, with the number of boxes, their heights and
    scores (5 to 95 %), the share of feet that project into the area, and classes; -o draws a frame of each camera.

    Parameters
    ----------
    run
        The run file (.h5), or a rig file (.toml).
    as_json
        Print one JSON object, with every track. Its keys are those of docs/outputs.md and stay.
    slice_
        Write one slice of the occupancy as a picture instead: t in seconds from the recording's first frame (or
        frame=NUMBER), plane in metres above the ground (or plane=all, the greatest of them); the nearest are taken.
    output
        The picture of the slice, PNG; of a rig file, a folder for the pictures.
    """
    if run.suffix.lower() == ".toml":
        if slice_ is not None or as_json:
            raise ConfigError("command line", "--slice" if slice_ else "--json", str(run), "a run file")
        _inspect_rig(run, output, overwrite)
        return
    found = read_run(run)
    if (slice_ is None) != (output is None):
        given, other = ("--slice", "-o SLICE.png") if output is None else ("-o", "--slice t=SECONDS,plane=METRES")
        raise ConfigError("command line", "", f"{given} alone", f"{other} with it")
    if slice_ is not None and output is not None:
        print(f"wrote {output}: {write_slice(found, slice_, output, overwrite)}")
        return
    overview = summarise_run(found)
    if as_json:
        print(json.dumps(asdict(overview), indent=1))
    else:
        _show(overview, output_console())


def _inspect_rig(path: Path, pictures: Path | None, overwrite: bool) -> None:
    """Print what each camera's source is and holds, and draw one frame of each camera into a folder."""
    recording = read_recording(path)
    summaries = summarise_sources(recording)
    console = output_console()
    console.print(table_of(COLUMNS, (summary.row() for summary in summaries), str(path)))
    for words in recording_warnings(recording, summaries):
        console.print(f"warning: {words}", style="yellow", soft_wrap=True)
    if pictures is not None:
        with_frames = write_source_pictures(recording, summaries, pictures, overwrite)
        contents = "with camera frames" if with_frames else "without camera frames"
        print(f"wrote {len(summaries)} pictures to {pictures} ({contents})")


def _show(overview: Overview, console: Console) -> None:
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0), title=overview.file, title_justify="left")
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for name, text in _lines(overview):
        table.add_row(name, text)
    console.print(table)
    console.print(_views(overview))
    if overview.tracks:
        console.print(_longest(overview))
    for warning in overview.warnings:
        console.print(f"warning: {warning}", style="yellow")


def _lines(overview: Overview) -> list[tuple[str, str]]:
    o = overview
    total = sum(o.seconds_by_stage.values())
    stages = [
        f"{name} {seconds:.1f} s" + (f" ({100 * seconds / total:.0f} %)" if total else "")
        for name, seconds in o.seconds_by_stage.items()
    ]
    ranked = sorted(o.ghost_reasons.items(), key=lambda reason: -reason[1])  # the most frequent first
    ground = (f"{views} see {100 * share:.0f} %" for views, share in enumerate(o.ground_by_views) if share > 0)
    lengths = "".join(f", {name} {length:.1f} s" for name, length in o.track_seconds.items())
    span = "" if o.first_frame is None else f", {o.first_frame} to {o.last_frame}"
    return [
        ("scene", f"{o.scene}: {counted(len(o.cameras), 'camera')} ({', '.join(o.cameras)}), run of {o.created}"),
        ("ground", f"x {o.x[0]:g} to {o.x[1]:g} m, y {o.y[0]:g} to {o.y[1]:g} m, cells of {o.cell:g} m"),
        ("planes", f"{o.planes} up to {o.top:g} m"),
        ("views", ", ".join(ground)),
        ("frames", f"{o.frames}{span}; {o.seconds:.1f} s at {o.frame_rate:g} frames/s"),
        ("people", f"{o.people_mean:.1f} a frame, at most {o.people_most}{_minutes(o.people_per_minute)}"),
        ("tracks", f"{len(o.tracks)}{lengths}; {100 * o.filled_points:.1f} % of their points predicted in gaps"),
        ("events", event_counts_text(o.events) or "none"),
        ("candidates", f"{o.candidates_per_frame:.1f} a frame, {o.ghosts_per_frame:.1f} of them ghosts"),
        ("ghosts", "; ".join(f"{count} because {words}" for words, count in ranked if count) or "none"),
        ("windows", f"{o.windows}, {o.frames_per_window:.1f} frames each"),
        ("work", f"{total:.1f} s, the sum over all workers and threads"),
        ("stages", ", ".join(stages) or "none"),
        ("size", f"{o.bytes / 1e6:.1f} MB, {o.bytes_per_frame / 1e3:.1f} kB a frame"),
    ]


def _minutes(people: list[float]) -> str:
    if len(people) < 2:
        return ""
    text_of_minutes = " ".join(f"{count:.1f}" for count in people[:_MINUTES])
    rest = "" if len(people) <= _MINUTES else f" ... ({len(people)} minutes)"
    return f"; minute by minute {text_of_minutes}{rest}"


def event_counts_text(counts: dict[str, int]) -> str:
    """Counts of events by kind; a split is the end of an encounter."""
    return ", ".join(f"{count} {event_word(kind)}" for kind, count in counts.items() if kind != "split")


def _views(overview: Overview) -> Table:
    """Error rates of each view at the end of the run, and the ghosts that it denies."""
    rows = []
    for name in overview.cameras:
        rates = overview.rates.get(name)
        errors = ("", "", "") if rates is None else tuple(f"{100 * rates[k]:.1f}" for k in ERROR_RATES)
        rows.append((name, *errors, str(overview.ghosts_denied_by[name])))
    return table_of(("view", "misses %", "clutter %", "beside people %", "denies ghosts"), rows, "views")


def _longest(overview: Overview) -> Table:
    longest, rows = overview.tracks[:_LONGEST], []
    for track in longest:
        seconds = f"{track['frames'] / overview.frame_rate:.1f}"
        numbers = (f"{track[name]:.0f}" for name in ("id", "frames", "first", "last"))
        rows.append((*numbers, seconds, f"{track['height']:.2f}", f"{track['score']:.1f}"))
    title = f"the {len(longest)} longest of {counted(len(overview.tracks), 'track')}"
    return table_of(("id", "frames", "first", "last", "seconds", "height m", "score"), rows, title)
