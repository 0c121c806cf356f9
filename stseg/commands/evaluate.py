"""`stseg evaluate`: scores of a run against truth."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from rich.table import Table

from stseg.arrays import Ints, Rows
from stseg.commands.calibrate.scene import area_of
from stseg.commands.terminal.counts import counted
from stseg.commands.terminal.standard_error import warn
from stseg.commands.terminal.standard_output import output_console
from stseg.errors import ConfigError
from stseg.evaluation import Scores
from stseg.evaluation import evaluate as score
from stseg.evaluation.advice import delay_advice, outside_advice, reading_advice
from stseg.evaluation.alignment import Alignment
from stseg.io.runfile.layout import SUFFIXES
from stseg.io.track_csv import read_tracks_csv
from stseg.io.untrusted import limits
from stseg.io.untrusted.values import abbreviated, parse_whole


def evaluate(
    tracks: Path,
    truth: Path,
    /,
    *,
    gate: float = 0.5,
    frames: str | None = None,
    area: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    ignore_flagged: Annotated[bool, Parameter(negative="")] = False,
    align: Alignment = "none",
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Score tracks on the ground against the truth.

    Example: stseg evaluate night.h5 truth.csv --frames 0:136 --area=1.9,-0.3,6.2,3.5

    Every frame of the truth counts, also one without tracks. Percentages: MODA, MODP, precision and recall evaluate
    each frame by itself; MOTA, IDF1 and HOTA evaluate identities as well. HOTA's similarity falls to 0 at the gate, and
    at twice the gate in "2 gates". MT and ML are the people mostly tracked (over 80 % of their frames) and mostly lost
    (under 20 %). "In gaps" is the number of positions that a run file predicts, and the share that meets a person.

    Parameters
    ----------
    tracks
        A run file (.h5), or CSV with a header and the columns frame,id,x,y (metres).
    truth
        CSV with the same columns; a column flag may mark unreliable rows.
    gate
        Metres within which a track matches a person.
    frames
        The frames to evaluate, A:B without B, or a list A,B,C. By default those of the truth.
    area
        x0,y0,x1,y1 in metres: people outside, and tracks matched to them, are ignored.
    ignore_flagged
        Ignore rows of the truth whose flag is not 0, and tracks matched to them.
    align
        Turn and shift the tracks onto the truth first (rigid), and scale them too (similarity): for a rig on a ground
        of its own, such as that of `stseg calibrate auto`.
    as_json
        Print one JSON object.
    """
    asked_frames = None if frames is None else _frames(frames)
    asked_area = None if area is None else area_of(area)
    rows, trajectory = read_tracks_csv(truth), _read(tracks)
    scores = score(rows, trajectory, gate, asked_area, asked_frames, ignore_flagged, align)
    if 2 * scores.hits < max(scores.truths, 1):
        advice = _advice(scores, rows, trajectory)
    else:
        advice = delay_advice(rows, trajectory, gate) if align == "none" else None
    outside = _outside(tracks, rows) if area is None and align == "none" else None
    warn([words for words in (advice, outside) if words])
    if as_json:
        print(json.dumps(scores.as_dict(), indent=1))
    else:
        output_console().print(_table(scores))


def _advice(scores: Scores, truth: Rows, trajectory: Rows) -> str | None:
    """The probable cause where tracks meet less than half of the truth; None where none is seen."""
    if not scores.truths:
        return "no row of the truth is evaluated: has it such frames (--frames), and people there (--area)?"
    if len(trajectory):
        first, last = trajectory["frame"].min(), trajectory["frame"].max()
        shared = int(((truth["frame"] >= first) & (truth["frame"] <= last)).sum())
        if shared < len(truth) and 2 * scores.hits >= shared > 0:
            return f"tracks are of the frames {first} to {last}, the truth of more: give --frames {first}:{last + 1}"
    return reading_advice(truth, trajectory, scores.gate)


def _outside(tracks: Path, truth: Rows) -> str | None:
    """Whether the truth reaches beyond the area of a run file."""
    if tracks.suffix.lower() not in SUFFIXES:
        return None
    from stseg.io.runfile.runs import read_run

    return outside_advice(truth, read_run(tracks).recording.rig.grid)


def _read(tracks: Path) -> Rows:
    if tracks.suffix.lower() not in SUFFIXES:
        return read_tracks_csv(tracks)
    from stseg.io.runfile.runs import read_trajectory

    return read_trajectory(tracks)


def _frames(text: str) -> Ints | range:
    given = [parse_whole(part, -limits.FRAMES, limits.FRAMES) for part in text.replace(":", ",").split(",")]
    numbers = [number for number in given if number is not None]
    whole = len(numbers) == len(given)
    if ":" in text:
        frames: Ints | range = range(*numbers) if whole and len(numbers) == 2 else range(0)
    else:
        frames = np.array(numbers if whole else [], np.int64)
    if not len(frames):
        expected = f"A:B with B above A, or a list A,B,C; numbers up to {limits.FRAMES}"
        raise ConfigError("command line", "--frames", abbreviated(text), expected)
    return frames


def _table(scores: Scores) -> Table:
    """Scores in five short rows, with the settings as the title."""
    place = "all the ground"
    if scores.area is not None:
        x0, y0, x1, y1 = scores.area
        place = f"x {x0:g} .. {x1:g}, y {y0:g} .. {y1:g} m"
    scale = "" if scores.scale == 1 else f", tracks scaled by {scores.scale:.3f}"
    title = f"{counted(scores.frames, 'frame')}, gate {scores.gate:g} m, {place}{scale}"
    table = Table(title=title, title_justify="left", show_header=False, box=None, padding=(0, 2, 0, 0))
    found = {"MODA": scores.moda, "precision": scores.precision, "recall": scores.recall, "MODP": scores.modp}
    followed = {"MOTA": scores.mota, "IDF1": scores.idf1, "HOTA": scores.hota, "2 gates": scores.hota_2gate}
    placed = {"mean": scores.location_mean, "median": scores.location_median, "MOTP": scores.motp}
    table.add_row("found", *(f"{name} {_percent(value)}" for name, value in found.items()))
    table.add_row("followed", *(f"{name} {_percent(value)}" for name, value in followed.items()))
    table.add_row("placed", *(f"{key} -" if value is None else f"{key} {value:.3f} m" for key, value in placed.items()))
    table.add_row(
        f"people {scores.people}",
        f"MT {scores.mostly_tracked}",
        f"ML {scores.mostly_lost}",
        f"switches {scores.switches}",
        f"fragments {scores.fragments}",
    )
    table.add_row(
        f"tracks {scores.tracks}",
        f"misses {scores.misses}",
        f"false alarms {scores.false_alarms}",
        f"false tracks {scores.false_tracks}",
        "" if scores.false_track_frames is None else f"mean {scores.false_track_frames:.1f} frames",
    )
    if scores.predictions:
        right = _percent(scores.predicted_precision)
        table.add_row(f"in gaps {scores.predictions}", f"precision {right}")
    return table


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f} %"
