"""Two readings of one recording: when the evidence decides for the alternative, and what is read anew then."""

from collections.abc import Sequence

import numpy as np
import pytest
from checks import cases
from coloured_people import RIG, rows_of
from scenes import CONFIG, corner_cameras, detector_of, evidence_of, found, people, rig_of

from stseg.detection.alternatives import best_alternative, likelihood_gain
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.prior import Prior
from stseg.detection.search.map_estimate import MapEstimate
from stseg.records.candidates import Candidates
from stseg.records.people import Explanation, People
from stseg.records.sparse_volume import SparseVolume
from stseg.trackers import FrameObservations, FusedFrame
from stseg.trackers.alternative_tracks import AcceptedAlternative, AlternativeTracks
from stseg.trackers.cut import CutTracker
from stseg.tracking.filter.track_filter import TrackFilter

WRONG, RIGHT = (-1.0, 0.5), (-0.3, -0.4)
UNSEEN = FrameObservations((None,) * 4, (None,) * 4)


def explained(standing: People, alternative: Explanation | None = None, gain: float | None = None) -> Explanation:
    return Explanation(standing, found(people()), (), (), (), np.zeros(4), 0, alternative, gain)


def decided(rate: float, gains: Sequence[float | None]) -> tuple[int, AcceptedAlternative | None]:
    """The frame after which an alternative is no more, -1 for none, and whether it was accepted."""
    tracks, followed = TrackFilter(rate, CONFIG), AlternativeTracks(rate)
    tracks.update(0, found(people(WRONG)), found(people()))
    for frame, gain in enumerate(gains, 1):
        expected = followed.predict(frame)
        beside = explained(found(people(RIGHT), expected))
        decision = followed.add(frame, explained(found(people(WRONG)), beside, gain), tracks)
        if decision is not None or followed.predict(frame + 1) is None:
            return frame, decision
    return -1, None


@cases()
def test_evidence_of_some_time_decides(rate: float, gains: list[float], last: int, is_accepted: bool) -> None:
    frame, decision = decided(rate, [None if np.isnan(gain) else gain for gain in gains])
    assert (frame, decision is not None) == (last, is_accepted)
    if decision is not None:
        assert list(decision.readings) == list(range(1, last))
        tracks = [reading.tracks.tolist() for reading in decision.readings.values()]
        assert decision.filter.issued > 1000 and all(one == tracks[0] for one in tracks)


def test_a_taken_alternative_reads_open_frames_anew() -> None:
    """Places, tracks and cells of frames before are those of the alternative; earlier frames stay as they were."""
    tracker, alternative = CutTracker(RIG, CONFIG, 0), AlternativeTracks(5.0)
    commits, volume = [], SparseVolume.whole(np.full(RIG.grid.shape, -3.0, np.float32))
    for frame in range(12):
        here = found(people(WRONG), tracker.predict(frame))
        beside = explained(found(people(RIGHT), alternative.predict(frame)))
        explanation = explained(here, beside if 4 <= frame < 8 else None, 6.0)
        if (decision := alternative.add(frame, explanation, tracker.filter)) is not None:
            tracker.take(decision)
            explanation = beside
        shown = explanation.people if frame < 7 else found(people(RIGHT), tracker.predict(frame))
        commits += tracker.add(FusedFrame(frame, shown, found(people()), volume), UNSEEN)
    commits += tracker.finish()
    rows = rows_of(commits)
    ground = np.stack([rows["x"], rows["y"]], 1)
    assert set(rows["frame"][np.hypot(*(ground - RIGHT).T) < 0.2]) == set(range(4, 12))
    assert set(rows["frame"][np.hypot(*(ground - WRONG).T) < 0.2]) >= set(range(3))
    assert not (np.hypot(*(ground - WRONG).T) < 0.2)[rows["frame"] >= 4].any()
    body = np.hypot(*(RIG.grid.ground - RIGHT).transpose(2, 0, 1)) < 0.1
    log_odds = {fused.frame: fused.log_odds for commit in commits for fused in commit.frames}
    assert (log_odds[4][:2, body] >= 1.0).all() and (log_odds[3][:, body] == -3.0).all()


def test_the_frame_alone_prefers_who_stands_there() -> None:
    rig = rig_of(corner_cameras()[:3])
    detector, standing = detector_of(rig, "pixels"), people((-0.8, 0.3), (0.9, -0.6), (0.2, 1.1))
    prior = Prior.of(None, detector.config, detector.body, detector.border)
    seen = detector.observe(evidence_of("pixels", rig.cameras, standing))
    untracked = FrameEvidence(detector.views, seen, prior, detector.parameters, detector.pixel_lattice)

    def candidates(*places: tuple[float, float]) -> Candidates:
        return Candidates(np.array(places), np.full(len(places), 1.7), np.full(len(places), detector.body.width_mean))

    true, wrong = candidates(*standing[:, :2].tolist()), candidates((-0.8, 0.3), (0.9, 0.2), (0.2, 1.1))
    gain = likelihood_gain(untracked, wrong, true)
    totals = [MapEstimate.of_members(untracked, people).total for people in (true, wrong)]
    assert gain is not None and gain == pytest.approx(totals[0] - totals[1]) and gain > 10.0
    assert likelihood_gain(untracked, true, candidates(*(standing[:, :2] + 0.05).tolist())) is None
    mixed = candidates((0.9, -0.6), (0.2, 1.1), (-1.2, -0.9))  # right in one place, wrong in another
    found_best = best_alternative(untracked, wrong, mixed)
    assert found_best is not None and found_best[1] == pytest.approx(gain)
    np.testing.assert_array_equal(np.sort(found_best[0].ground, 0), np.sort(true.ground, 0))
    assert best_alternative(untracked, true, wrong) is None and best_alternative(untracked, true, true) is None
