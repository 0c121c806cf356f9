"""How many answers bring the identities of a run to the truth.

    python tools/experiment.py answers RUN.h5 TRUTH.csv [--area=x0,y0,x1,y1] [--frames A:B] [--batch 5] [--most 100]

The truth answers the questions of `stseg review` in their order, a batch at a time; after each batch `stseg correct`
solves identities again, and the next batch comes from the corrected run. The first row is the run as it is. `bound` is
the IDF1 of perfect identities on the same places: 2 TP / (truths + detections).

Questions that the truth cannot answer, since nobody of it stands within the gate, are passed over, as a person would
who does not know; they count as asked.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from stseg.arrays import Ints, Rows
from stseg.errors import InputError
from stseg.evaluation import evaluate
from stseg.evaluation.matching import distances, match
from stseg.evaluation.scores import Scores
from stseg.identities.review.corrections import Answer
from stseg.identities.review.doubts import Doubt
from stseg.io.runfile.corrected import write_corrected
from stseg.io.runfile.runs import Run, read_run
from stseg.io.track_csv import read_tracks_csv
from stseg.tasks.correction import CorrectedTracks, corrected_tracks
from stseg.tasks.doubtful_decisions import doubtful_decisions

GATE = 0.5
"""Greatest distance of a track from its person, metres."""
AROUND = 2.0
"""Time before and after a decision in which the truth says who a track is, seconds."""
NOBODY = -1


@dataclass(frozen=True)
class Oracle:
    """Answers questions about the tracks of a run by the truth.

    Attributes
    ----------
    rows : TRAJECTORY (n,)
    person : int64 (n,)
        Person of each row, `NOBODY` where none stands within the gate.
    frame_rate
        Frames per second.
    """

    rows: Rows
    person: Ints
    frame_rate: float

    @classmethod
    def of(cls, run: Run, truth: Rows) -> Oracle:
        """Match the tracks of a run to the truth, frame by frame."""
        rows = run.trajectory
        person = np.full(len(rows), NOBODY)
        for frame in np.unique(rows["frame"]).tolist():
            own, true = np.flatnonzero(rows["frame"] == frame), np.flatnonzero(truth["frame"] == frame)
            people, tracks = (np.column_stack([one["x"], one["y"]]) for one in (truth[true], rows[own]))
            matched, track = match(distances(people, tracks), GATE)
            person[own[track]] = truth["id"][true[matched]]
        return cls(rows, person, run.frame_rate)

    def who(self, track: int, since: float, until: float) -> int:
        """Whom most rows of a track between two frames show, the second left out."""
        frame = self.rows["frame"]
        shown = self.person[(self.rows["id"] == track) & (frame >= since) & (frame < until)]
        people, count = np.unique(shown[shown != NOBODY], return_counts=True)
        return int(people[count.argmax()]) if len(people) else NOBODY

    def answers(self, doubt: Doubt) -> list[Answer]:
        """The answer to a question of the review page, empty where the truth does not know."""
        if doubt.question == "encounter":
            return self._encounter(doubt)
        if doubt.question == "birth":
            return self._birth(doubt)
        if doubt.question == "gap":
            reach = AROUND * self.frame_rate
            early = self.who(doubt.track, doubt.first - reach, doubt.first + 1)
            late = self.who(doubt.other, doubt.last, doubt.last + reach)
            action = "join" if early == late else "keep"
            return [] if NOBODY in (early, late) else [answer(action, doubt.track, doubt.other, doubt.last)]
        shown = self.person[self.rows["id"] == doubt.track] != NOBODY
        return [answer("keep" if 2 * shown.sum() >= len(shown) else "delete", doubt.track)]

    def _birth(self, doubt: Doubt) -> list[Answer]:
        reach, frame = AROUND * self.frame_rate, doubt.last
        was = self.who(doubt.track, frame - reach, frame)
        now, begun = (self.who(one, frame, frame + reach) for one in (doubt.track, doubt.other))
        if was == begun != NOBODY:
            return [answer("swap", doubt.track, doubt.other, frame)]
        if NOBODY in (was, now):
            return []
        kept = answer("keep", doubt.track, doubt.other, frame)
        return [kept if was == now else answer("split", doubt.track, 0, frame)]

    def _encounter(self, doubt: Doubt) -> list[Answer]:
        reach, pair = AROUND * self.frame_rate, (doubt.track, doubt.other)
        before = [self.who(one, doubt.first - reach, doubt.first) for one in pair]
        after = [self.who(one, doubt.last + 1, doubt.last + 1 + reach) for one in pair]
        frame = (doubt.first + doubt.last + 1) // 2
        if NOBODY not in (*before, *after) and before == after[::-1]:
            return [answer("swap", *pair, frame)]
        people = zip(pair, before, after, strict=True)
        others = [one for one, was, is_ in people if was != is_ and NOBODY not in (was, is_)]
        if others or NOBODY in (*before, *after):
            return [answer("split", one, 0, frame) for one in others]
        return [answer("keep", *pair, frame)]


def answer(action: str, track: int, other: int = 0, frame: int | None = None) -> Answer:
    """An answer of the truth; joins are of whole tracks."""
    return Answer(f"{action} {track} {other} at {frame}", action, track, other, None if action == "join" else frame)


def batch_of(doubts: list[Doubt], oracle: Oracle, size: int) -> tuple[int, list[Answer]]:
    """How many questions are asked until so many are answered, and the answers."""
    answers, answered = list[Answer](), 0
    for asked, doubt in enumerate(doubts, 1):
        given = oracle.answers(doubt)
        answers += given
        answered += bool(given)
        if answered == size:
            return asked, answers
    return len(doubts), answers


def table(asked: argparse.Namespace, folder: Path) -> None:
    """Print a row for each batch."""
    run, truth = read_run(asked.run), read_tracks_csv(asked.truth)
    first, stop = asked.frames or (int(run.frames[0]), int(run.frames[-1]) + 1)
    truth = truth[(truth["frame"] >= first) & (truth["frame"] < stop)]
    print("| answered | changes | IDF1 | bound | MODA | switches | seconds |")
    print("| --: | --: | --: | --: | --: | --: | --: |")
    answered, changes, begun = 0, 0, time.perf_counter()
    while True:
        scores = evaluate(truth, run.trajectory, area=asked.area, frames=np.arange(first, stop))
        seconds = time.perf_counter() - begun
        print(f"| {answered} | {changes} | {figures(scores)} | {seconds:.0f} |", flush=True)
        begun = time.perf_counter()
        _, given = batch_of(doubtful_decisions(run), Oracle.of(run, truth), asked.batch)
        if not given or answered >= asked.most:
            return
        given, found = obeyed(run, given)
        answered += len(given)
        changes += sum(one.action != "keep" for one in given)
        path = folder / f"{answered}.h5"
        write_corrected(run.path, path, found.tracks, found.answered, found.new_ids, found.names, "", True)
        run = read_run(path)


def obeyed(run: Run, answers: list[Answer]) -> tuple[list[Answer], CorrectedTracks]:
    """Answers without those that contradict others, and the tracks under them."""
    while True:
        try:
            return answers, corrected_tracks(run, answers)
        except InputError as error:
            left = [one for one in answers if one.place not in str(error)]
            if len(left) == len(answers):
                raise
            answers = left


def figures(scores: Scores) -> str:
    """Cells of the scores."""
    bound = 200 * scores.hits / (scores.truths + scores.detections)
    return f"{scores.idf1:.1f} | {bound:.1f} | {scores.moda:.1f} | {scores.switches}"


def main() -> None:
    """Read the command line and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("--area", type=lambda text: tuple(map(float, text.split(","))))
    parser.add_argument("--frames", type=lambda text: tuple(map(int, text.split(":"))))
    parser.add_argument("--batch", type=int, default=5)
    parser.add_argument("--most", type=int, default=100)
    with TemporaryDirectory() as folder:
        table(parser.parse_args(), Path(folder))
