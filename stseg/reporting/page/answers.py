"""Summary of a run as questions and answers of a sentence or two (HTML)."""

from collections.abc import Sequence

import numpy as np

from stseg.arrays import Floats, Rows
from stseg.records.ghost_reasons import REASONS, GhostReasons
from stseg.reporting.charts import clock_time
from stseg.reporting.pictures.maps import DwellPlace
from stseg.reporting.run_statistics import Span


def answers(
    span: Span,
    frames: int,
    trajectory: Rows,
    tracks: Rows,
    events: Rows,
    candidates: int,
    reasons: GhostReasons,
    places: Sequence[DwellPlace],
    shares: Floats,
) -> list[tuple[str, str]]:
    """Questions and their answers.

    Parameters
    ----------
    frames
        Number of frames of the run.
    trajectory, tracks, events
        TRAJECTORY, TRACK and EVENT rows.
    candidates
        Number of candidates, people and ghosts.
    reasons
        Reasons against the ghosts.
    places
        Places where most time is spent.
    shares : float64 (views + 1,)
        Share of the ground that 0, 1, 2, ... views see.
    """
    return [
        ("How many people?", _people(span, frames, trajectory, tracks)),
        ("Where do they dwell?", _dwelling(places, len(trajectory))),
        ("What was dropped as a ghost, and why?", _ghosts(frames, candidates, reasons, events)),
        ("Where is the rig blind?", _blind(shares)),
    ]


def _people(span: Span, frames: int, trajectory: Rows, tracks: Rows) -> str:
    if not len(trajectory):
        return "No person was found."
    counts = np.unique(trajectory["frame"], return_counts=True)[1]
    lengths = (tracks["last"] - tracks["first"] + 1) / span.frame_rate
    return (
        f"<b>{counts.sum() / max(frames, 1):.1f}</b> at a time on average, at most <b>{counts.max()}</b>. "
        f"There are <b>{len(tracks)}</b> tracks, half of them {clock_time(float(np.median(lengths)))} or longer; a "
        "person who leaves and comes back is a new track."
    )


def _dwelling(places: Sequence[DwellPlace], rows: int) -> str:
    if not rows:
        return "No person was found."
    if not places:
        return "Nowhere in particular: their time is spread over the ground."
    named = [
        f"<b>{letter}</b> at ({place.x:.1f}, {place.y:.1f}), {100 * place.share:.0f} %"
        for letter, place in zip("ABC", places, strict=False)
    ]
    share = "the share is that of all the time that people spend here, within 0.75 m"
    return f"Most around {'; '.join(named)} ({share}; the map is below)."


def _ghosts(frames: int, candidates: int, reasons: GhostReasons, events: Rows) -> str:
    count = len(reasons.ghosts)
    short = int((events["kind"] == b"dropped").sum())
    were = "was" if short == 1 else "were"
    tracks = f" {short} track{'' if short == 1 else 's'} too short or too uncertain {were} dropped as well."
    if not count:
        return "No candidate was dropped." + (tracks if short else "")
    ranked = sorted(zip(reasons.counts(), REASONS, strict=True), reverse=True)
    why = "; ".join(f"{100 * number / count:.0f} % because {words}" for number, words in ranked if number)
    return f"<b>{count:,}</b> of {candidates:,} candidates ({count / max(frames, 1):.1f} a frame): {why}." + (
        tracks if short else ""
    )


def _blind(shares: Floats) -> str:
    none, one = 100 * shares[0], 100 * (shares[1] if len(shares) > 1 else 0.0)
    lone = f"<b>{one:.0f} %</b> by one alone, which cannot tell a person from a ghost"
    return f"<b>{none:.0f} %</b> of the ground is seen by no view, {lone}, and {100 - none - one:.0f} % by two or more."
