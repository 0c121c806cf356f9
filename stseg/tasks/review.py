"""A page that asks about the decisions of which a run is least sure, in the order of doubt.

That is by what solving identities with the opposite decision loses.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from stseg.arrays import Observation
from stseg.engine.offline.known import rows_with_ids
from stseg.engine.pipeline import identity_problem
from stseg.identities.review.doubts import Doubt, find_doubts
from stseg.identities.review.weighed_doubts import weighed_doubts
from stseg.io.config_file import parse_config
from stseg.io.outputs.whole_files import Inputs, require_output, write_file
from stseg.io.runfile.runs import Run, read_run
from stseg.records.border import Border
from stseg.reporting.charts import clock_time
from stseg.reporting.page.review_page import Question, best_views, moment_picture, plan_film, review_page
from stseg.tasks.correction import answered_before, is_solved_again
from stseg.tasks.report import read_views

_LEAST_CHANCE = 0.01
"""Probability that a decision is wrong from which on it is asked about."""
_WEIGHED_DECISIONS = 300
"""Decisions that are weighed so, those with the least margins by heights and motion alone; the others come after."""


def doubtful_decisions(run: Run) -> list[Doubt]:
    """Doubtful decisions of a run, the most doubtful first; without those that were answered before."""
    if not len(run.trajectory):
        return []
    found = find_doubts(run.trajectory, run.frame_rate, Border.of(run.recording.rig))
    if not is_solved_again(run):
        return found
    weighed = sorted(_weighed(run, found[:_WEIGHED_DECISIONS]), key=lambda one: (one.margin, one.first, one.track))
    return weighed + found[_WEIGHED_DECISIONS:]


def _weighed(run: Run, doubts: Sequence[Doubt]) -> list[Doubt]:
    """Doubts of which the margins are log-odds, under the answers that were given before."""
    kept, constraints = answered_before(run).kept
    config = parse_config(run.provenance.config, f"{run.path}: configuration")
    rig = run.recording.reduced(config.foreground.body_rows).reduced_rig
    problem = identity_problem(rig, config, run.committed[kept], run.appearance, constraints)
    return weighed_doubts(doubts, rows_with_ids(run)[kept], problem, constraints)


def write_review(run_file: Path, output: Path, *, most: int, camera_images: bool, overwrite: bool) -> int:
    """Write a page with questions about a run, the most doubtful decisions first; their number.

    Raises
    ------
    InputError
        Where the run file cannot be read, or the page exists.
    """
    run = read_run(run_file)
    require_output(output, overwrite, Inputs(run.files))
    run.require_consistency()
    doubts = [one for one in doubtful_decisions(run) if one.chance >= _LEAST_CHANCE][:most]
    frames = sorted({frame for doubt in doubts for _, frame in _moments(run, doubt)})
    views = read_views(run.recording, frames) if camera_images and doubts else {}
    questions = [_question(run, doubt, views) for doubt in doubts]
    page = review_page(f"{run.scene}: review", run_file.name, run.recording.rig.grid, questions, camera_images)
    write_file(output, page.encode(), overwrite)
    return len(questions)


def _moments(run: Run, doubt: Doubt) -> tuple[tuple[str, int], ...]:
    second = max(1, round(run.frame_rate))
    first, last = int(run.frames[0]), int(run.frames[-1])
    before, after = max(first, doubt.first - second), min(last, doubt.last + second)
    if doubt.question == "false":
        before, after = doubt.first, doubt.last
    return ("before", before), ("during", (doubt.first + doubt.last) // 2), ("after", after)


def _question(run: Run, doubt: Doubt, views: Mapping[int, tuple[Observation, ...]]) -> Question:
    rig, ids = run.recording.rig, [one for one in (doubt.track, doubt.other) if one]
    moments, unseen = _moments(run, doubt), (None,) * len(run.cameras)
    rows = run.trajectory[np.isin(run.trajectory["id"], ids)]
    nearby = rows[(rows["frame"] >= moments[0][1]) & (rows["frame"] <= moments[2][1])]
    ground = np.array([[part["x"].mean(), part["y"].mean()] for k in ids if len(part := nearby[nearby["id"] == k])])
    pictures = [
        (
            f"{words}, frame {frame}, {run.cameras[view]}",
            moment_picture(
                rig, view, run.trajectory, frame, ids, views.get(frame, unseen)[view], round(2 * run.frame_rate)
            ),
        )
        for view in best_views(rig, ground)
        for words, frame in moments
        if views
    ]
    first, last = moments[0][1] - round(run.frame_rate), moments[2][1] + round(run.frame_rate)
    film = plan_film(run.trajectory, first, last, doubt.first, run.frame_rate, ids)
    (x, y), seconds = ground.mean(axis=0), doubt.first / run.frame_rate
    (words, choices), wrong = question_words(doubt), f"wrong with a probability of {100 * doubt.chance:.0f} %"
    wrong += ": a second look, by the other answer, fits better" if doubt.chance > 1 / 2 else ""
    at = f"{words} At {clock_time(seconds)}, near ({x:.1f}, {y:.1f}); the run is {wrong}."
    return Question(at, [*choices, ("0", "cannot tell", "")], pictures, film)


def question_words(doubt: Doubt) -> tuple[str, list[tuple[str, str, str]]]:
    """A question, and the key, the words and the lines of each of its answers."""
    a, b, frame = doubt.track, doubt.other, doubt.frame
    keep = f"keep,{frame},{a},{b or ''},"
    if doubt.question == "encounter":
        swap = ("2", "they were swapped", f"swap,{frame},{a},{b},")
        one, two = (f"split,{frame},{track},," for track in (a, b))
        others = [("3", f"{a} is somebody else", one), ("4", f"{b} is", two), ("5", "both are", f"{one}\n{two}")]
        return f"Are {a} and {b} after the encounter who they were before?", [("1", "same people", keep), swap, *others]
    if doubt.question == "birth":
        swap = ("2", f"{b} is who was {a}", f"swap,{doubt.last},{a},{b},")
        other = ("3", f"{a} is somebody else from then on", f"split,{doubt.last},{a},,")
        return f"{b} begins: is it the person who was {a} until then?", [("1", f"no, {a} goes on", keep), swap, other]
    if doubt.question == "gap":
        keep = f"keep,,{a},{b},"  # no frame of a gap is one of a track
        join = ("2", "the same person", f"join,,{a},{b},")
        return f"Is {b} the person who was {a}?", [("1", "two people", keep), join]
    return f"Is {a} a person?", [("1", "a person", keep), ("2", "no person", f"delete,,{a},,")]
