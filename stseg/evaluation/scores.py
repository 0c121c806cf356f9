"""All scores of one run."""

import math
from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats, Ints, Rows
from stseg.errors import ConfigError
from stseg.evaluation.alignment import Alignment, best_motion, moved_rows
from stseg.evaluation.clear import (
    Matches,
    false_tracks,
    fragments,
    idf1,
    match_per_frame,
    match_with_continuity,
    matched_share,
    switches,
)
from stseg.evaluation.hota import hota
from stseg.evaluation.sequence import Area, Sequence, align_frames, require_tables


@dataclass(frozen=True, slots=True)
class Scores:
    """Scores of tracks against the truth; None where a ratio has no denominator.

    Attributes
    ----------
    gate, area, frames
        Settings of the evaluation: gate in metres, ground rectangle in metres, number of frames.
    scale
        Factor of the tracks' lengths by the alignment; 1 without one.
    truths, detections
        Number of evaluated rows of the truth and of the tracks.
    people, tracks
        Number of ids in them.
    hits, false_alarms, misses
        Matches of each frame independently, detections and truths without one.
    moda, modp, precision, recall
        Percent, from those matches; MODP is the mean of 1 - distance / gate.
    predictions, predicted_precision
        Number of the tracks' rows that are predicted in filled gaps, and the percentage of them that meet a person.
    location_mean, location_median
        Distance of those matches, metres.
    mota
        Percent, from CLEAR's matches.
    motp
        Mean distance of CLEAR's matches, metres.
    idf1, hota, hota_2gate
        Percent. HOTA's similarity falls to 0 at the gate; hota_2gate's at twice the gate.
    switches, fragments
        Number of changes of a person's track; number of times a person is matched again after a gap.
    mostly_tracked, mostly_lost
        People matched in more than 80 % and in less than 20 % of their frames.
    false_tracks, false_track_frames
        Tracks matched in at most half of their frames, and the mean number of their frames.
    """

    gate: float
    area: Area | None
    frames: int
    scale: float
    truths: int
    detections: int
    people: int
    tracks: int
    hits: int
    false_alarms: int
    misses: int
    moda: float | None
    modp: float | None
    precision: float | None
    recall: float | None
    predictions: int
    predicted_precision: float | None
    location_mean: float | None
    location_median: float | None
    mota: float | None
    motp: float | None
    idf1: float
    hota: float
    hota_2gate: float
    switches: int
    fragments: int
    mostly_tracked: int
    mostly_lost: int
    false_tracks: int
    false_track_frames: float | None

    def as_dict(self) -> dict[str, object]:
        """The figures under their names in the literature, percent to two decimals and metres to four."""
        figures: dict[str, object] = {
            "frames": self.frames,
            "n_truth": self.truths,
            "n_det": self.detections,
            "n_people": self.people,
            "n_tracks": self.tracks,
            "TP": self.hits,
            "FP": self.false_alarms,
            "FN": self.misses,
            "MODA": _rounded(self.moda, 2),
            "MODP": _rounded(self.modp, 2),
            "precision": _rounded(self.precision, 2),
            "recall": _rounded(self.recall, 2),
            "MOTA": _rounded(self.mota, 2),
            "MOTP_m": _rounded(self.motp, 4),
            "IDF1": _rounded(self.idf1, 2),
            "HOTA": _rounded(self.hota, 2),
            "HOTA_2gate": _rounded(self.hota_2gate, 2),
            "IDSW": self.switches,
            "MT": self.mostly_tracked,
            "ML": self.mostly_lost,
            "Frag": self.fragments,
            "false_tracks": self.false_tracks,
            "false_track_mean_frames": _rounded(self.false_track_frames, 4),
            "location_error_m": {"mean": _rounded(self.location_mean, 4), "median": _rounded(self.location_median, 4)},
            "gate_m": self.gate,
            "area": None if self.area is None else list(self.area),
            "HOTA_similarity": "1 - d/gate",
        }
        if self.scale != 1:
            figures["scale"] = round(self.scale, 4)
        if self.predictions:
            figures |= {"n_predicted": self.predictions, "predicted_precision": _rounded(self.predicted_precision, 2)}
        return figures


def evaluate(
    truth: Rows,
    trajectory: Rows,
    gate: float = 0.5,
    area: Area | None = None,
    frames: Ints | range | None = None,
    ignore_flagged: bool = False,
    align: Alignment = "none",
) -> Scores:
    """Score ground tracks against the truth.

    Parameters
    ----------
    truth, trajectory
        Tables with the columns frame, id, x, y (metres), such as TRAJECTORY; the truth may have a column flag. The ids
        of the two need not correspond.
    gate
        Metres within which a track matches a person.
    area
        Lower x, lower y, upper x, upper y, metres: people outside are ignored, as are the tracks matched to them and
        unmatched tracks outside.
    frames : int64 or range, optional
        The frames to evaluate; by default those of the truth. A frame without detections counts.
    ignore_flagged
        Treat rows of the truth with a flag other than 0 as people outside the area.
    align
        Turn and shift the tracks onto the truth first ("rigid"), and scale them too ("similarity"): for rigs whose
        ground is not that of the truth.

    Raises
    ------
    ConfigError
        Where the gate is not above 0, the area is turned inside out, or frames are a pair.
    FormatError
        Where one is no such table, a position is not finite, or an id occurs twice in a frame.
    """
    if not (math.isfinite(gate) and gate > 0):
        raise ConfigError("evaluation", "gate", gate, "metres, above 0")
    if area is not None and not (area[0] < area[2] and area[1] < area[3]):
        raise ConfigError("evaluation", "area", area, "x0, y0, x1, y1 in metres with x0 below x1 and y0 below y1")
    if isinstance(frames, tuple):  # elsewhere a pair is first and stop
        raise ConfigError("evaluation", "frames", frames, "a range, or an array of every frame")
    require_tables(truth=truth, tracks=trajectory)
    motion = best_motion(truth, trajectory, gate, align)
    sequence = align_frames(truth, moved_rows(trajectory, motion), gate, area, frames, ignore_flagged)
    matches = match_per_frame(sequence, gate), match_with_continuity(sequence, gate)
    return _score(sequence, *matches, gate, area, abs(motion.factor))


def _score(
    sequence: Sequence, per_frame: Matches, kept: Matches, gate: float, area: Area | None, scale: float
) -> Scores:
    truths, detections, hits, swaps = sequence.truths, sequence.detections, len(per_frame), switches(kept)
    share, false = matched_share(kept, sequence), false_tracks(kept, sequence)
    return Scores(
        gate=gate,
        area=area,
        frames=sequence.length,
        scale=scale,
        truths=truths,
        detections=detections,
        people=sequence.people,
        tracks=sequence.tracks,
        hits=hits,
        false_alarms=detections - hits,
        misses=truths - hits,
        # 1 - (misses + false alarms) / truths = (2 hits - detections) / truths
        moda=_percent(2 * hits - detections, truths),
        modp=_percent(float((1 - per_frame.distance / gate).sum()), hits),
        precision=_percent(hits, detections),
        recall=_percent(hits, truths),
        predictions=sequence.predictions,
        predicted_precision=_percent(int(per_frame.predicted.sum()), sequence.predictions),
        location_mean=_mean(per_frame.distance),
        location_median=float(np.median(per_frame.distance)) if hits else None,
        mota=_percent(2 * len(kept) - detections - swaps, truths),
        motp=_mean(kept.distance),
        idf1=100 * idf1(sequence, gate),
        hota=100 * hota(sequence, gate),
        hota_2gate=100 * hota(sequence, 2 * gate),
        switches=swaps,
        fragments=fragments(kept),
        mostly_tracked=int((share > 0.8).sum()),
        mostly_lost=int((share < 0.2).sum()),
        false_tracks=int(false.sum()),
        false_track_frames=_mean(sequence.track_frames[false]),
    )


def _percent(part: float, whole: int) -> float | None:
    return 100.0 * part / whole if whole else None


def _mean(values: Floats | Ints) -> float | None:
    return float(values.mean()) if len(values) else None


def _rounded(value: float | None, decimals: int) -> float | None:
    return None if value is None else round(value, decimals)
