"""`stseg.correct`: identities solved again, with the answers of a person as hard constraints."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.engine.offline.known import rows_with_ids
from stseg.engine.pipeline import associated_tracks
from stseg.engine.recordings import run_of
from stseg.errors import FormatError, InputError
from stseg.identities.review.answered_constraints import AnsweredRows, answered_rows
from stseg.identities.review.corrections import ACTIONS, Answer, Corrections, solve_corrections
from stseg.identities.search.constraints import Constraints
from stseg.io.answers import read_answers
from stseg.io.config_file import parse_config
from stseg.io.outputs.whole_files import Inputs, require_output
from stseg.io.runfile.corrected import write_corrected
from stseg.io.runfile.runs import Run, read_run
from stseg.io.untrusted.bounded_files import read_text, reading
from stseg.records.tables import Tracks
from stseg.trajectories.final_tracks import CommittedRows


@dataclass(frozen=True)
class CorrectedTracks:
    """Tracks under answers."""

    tracks: Tracks
    answered: Rows
    """ANSWER (n,): everything answered so far."""
    new_ids: Callable[[Ints, Ints], Ints]
    """Corrected ids of labels by the run's id and frame, 0 where they are no person."""
    names: dict[int, str]
    """Names by corrected id."""


class CorrectedRun(NamedTuple):
    """A corrected run, and the answers that it is corrected by."""

    run: Run
    answers: tuple[Answer, ...]


def correct(run: Run | Path | str, answers: Path | str, output: Path | str, *, overwrite: bool = False) -> CorrectedRun:
    """Write a run file with corrected identities, as `stseg correct` does; the run itself stays as it is.

    Parameters
    ----------
    run
        The run, or its file.
    answers
        CSV with the columns action,frame,id,other,name; see `stseg correct --help` for the actions.
    output
        The run file to write.
    overwrite
        Replace the file if it exists.

    Returns
    -------
    CorrectedRun
        The run of the written file, and the answers.

    Raises
    ------
    InputError
        For an answer that names no such track or frame, or that contradicts another.
    """
    found, output, answers = run_of(run), Path(output), Path(answers)
    require_output(output, overwrite, Inputs(found.files, [answers]))
    rows = read_answers(answers, ACTIONS)
    with reading(answers, "answers as CSV"):
        text = read_text(answers)
    if "\0" in text:
        raise FormatError(answers, "", "a NUL character", "answers as CSV")
    given = tuple(Answer(row.place, row.action, row.track, row.other, row.frame, row.name) for row in rows)
    corrected = corrected_tracks(found, given)
    write_corrected(
        found.path, output, corrected.tracks, corrected.answered, corrected.new_ids, corrected.names, text, overwrite
    )
    return CorrectedRun(read_run(output), given)


def corrected_tracks(run: Run, answers: Sequence[Answer]) -> CorrectedTracks:
    """The tracks of a run under answers; each keeps the id of the run's track in which it begins.

    Identities are solved again where the run has the rows that its tracker committed, under answers given before, too.
    Else ids are exchanged from the frames of the answers on.

    Raises
    ------
    InputError
        For an answer that names no such track or frame, or that contradicts another.
    """
    linked = solve_corrections(run.tracks, answers)
    if not is_solved_again(run):
        return _renamed(run, linked)
    old = rows_with_ids(run)
    answered = answered_before(run) + answered_rows(old, answers, run.frame_rate)
    kept, constraints = answered.kept
    config = parse_config(run.provenance.config, f"{run.path}: configuration")
    rig = run.recording.reduced(config.foreground.body_rows).reduced_rig
    rows = CommittedRows(run.committed[kept], run.committed_events, run.appearance, run.known_people)
    tracks, identity = associated_tracks(rig, config, rows, run.recording.rig, constraints)
    _require_obeyed(constraints, answered.places, identity, rows.trajectory["frame"])
    numbers = _numbers(old[kept], identity, np.concatenate([tracks.events["id"], tracks.events["other"]]))
    solved = Tracks(*(_numbered(rows, numbers) for rows in (tracks.trajectory, tracks.boxes, tracks.events)))
    new = np.zeros(len(old), np.int64)
    new[kept] = [numbers.get(one, 0) for one in identity.tolist()]
    given = run.names | {answer.track: answer.name for answer in answers if answer.action == "name"}
    return CorrectedTracks(solved, answered.table, _label_ids(old, new), _names(old, new, given))


def is_solved_again(run: Run) -> bool:
    """Whether answers solve the identities of a run again: it has committed rows, and what was answered before."""
    return len(run.committed) > 0 and (len(run.answers) > 0 or not run.corrected)


def answered_before(run: Run) -> AnsweredRows:
    """Earlier answers on the committed rows of a run; raises FormatError where they name no such rows."""
    table, number = run.answers, len(run.committed)
    last = np.maximum(table["row"], table["other"])
    if (last >= number).any():
        raise FormatError(run.path, "/answers", f"row {last.max()}", f"rows of /committed, which has {number}")
    frame = run.committed["frame"]
    if (frame[table["row"]] > frame[table["other"]]).any():
        raise FormatError(run.path, "/answers", "a row after its other", "rows in the order of frames")
    return AnsweredRows.of_table(table, number)


def _require_obeyed(constraints: Constraints, places: Sequence[str], identity: Ints, frame: Ints) -> None:
    """Raise InputError where constraints contradict each other, or one on rows that are in tracks is not obeyed."""
    both = (identity[constraints.earlier] > 0) & (identity[constraints.later] > 0)
    broken = np.flatnonzero(constraints.violated(identity) & both | constraints.contradictory(frame))
    if len(broken):
        raise InputError(places[broken[0]], "answer", "one that contradicts others", "answers that can all be true")


def _numbers(old: Rows, identity: Ints, others: Ints) -> dict[int, int]:
    """The run's id for each identity: that of the first row that has one, a new one where it is taken."""
    last_id, numbers, used_ids = int(old["id"].max(initial=0)), dict[int, int](), set[int]()
    order = np.lexsort((old["id"], old["frame"]))
    named = order[(identity[order] > 0) & (old["id"][order] > 0)]
    for row in [*named.tolist(), *order.tolist()]:
        one, earlier_id = int(identity[row]), int(old["id"][row])
        if one > 0 and one not in numbers:
            if earlier_id == 0 or earlier_id in used_ids:
                last_id, earlier_id = last_id + 1, last_id + 1
            numbers[one] = earlier_id
            used_ids.add(earlier_id)
    for one in np.unique(others[others > 0]).tolist():
        if one not in numbers:
            last_id += 1
            numbers[one] = last_id
    return numbers


def _numbered(rows: Rows, numbers: dict[int, int]) -> Rows:
    """Rows under other ids, in the order of frames and ids."""
    rows = rows.copy()
    for name in {"id", "other"} & set(rows.dtype.names or ()):
        rows[name] = [numbers.get(one, 0) for one in rows[name].tolist()]
    return np.asarray(rows[np.lexsort((rows["id"], rows["frame"]))])


def _label_ids(old: Rows, new: Ints) -> Callable[[Ints, Ints], Ints]:
    named = np.flatnonzero(old["id"] > 0)
    span = int(old["frame"].max(initial=0)) + 1
    key = old["id"][named] * span + old["frame"][named]
    order = np.argsort(key)
    key, value = key[order], new[named[order]]

    def new_ids(identity: Ints, frame: Ints) -> Ints:
        keys = identity * span + np.minimum(frame, span - 1)
        index = np.searchsorted(key, keys).clip(max=max(len(key) - 1, 0))
        return np.where(key[index] == keys, value[index], 0) if len(key) else np.zeros(len(identity), np.int64)

    return new_ids


def _names(old: Rows, new: Ints, names: dict[int, str]) -> dict[int, str]:
    """Names by corrected id: that of the first row of the track that was named."""
    found = dict[int, str]()
    for identity, name in names.items():
        rows = np.flatnonzero((old["id"] == identity) & (new > 0))
        if len(rows):
            found[int(new[rows[np.argmin(old["frame"][rows])]])] = name
    return found


def _renamed(run: Run, linked: Corrections) -> CorrectedTracks:
    """The run's tracks under the ids of corrected links."""

    def of(rows: Rows) -> Rows:
        rows = rows.copy()
        rows["id"] = linked.map(rows["id"], rows["frame"])
        return np.asarray(rows[rows["id"] > 0])

    trajectory, events = of(run.trajectory), of(run.events)
    events["other"] = linked.map(events["other"], events["frame"])
    trajectory = trajectory[np.lexsort((trajectory["id"], trajectory["frame"]))]
    tracks = Tracks(trajectory, of(run.boxes), events)
    return CorrectedTracks(tracks, run.answers, linked.map, run.names | linked.names)
