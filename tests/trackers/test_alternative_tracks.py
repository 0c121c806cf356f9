"""Two readings of one recording: when the evidence decides for the alternative, and what is read anew then."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from checks import cases
from coloured_people import RIG, rows_of
from scenes import CONFIG, corner_cameras, detector_of, evidence_of, found, people, rig_of

from stseg.arrays import Floats
from stseg.detection.alternatives import best_alternative, likelihood_gain
from stseg.detection.frame_evidence import FrameEvidence
from stseg.detection.prior import Prior
from stseg.detection.search.map_estimate import MapEstimate
from stseg.records.candidates import Candidates
from stseg.records.people import Alternative, Explanation, People
from stseg.records.predicted_tracks import PredictedTracks
from stseg.records.sparse_volume import SparseVolume
from stseg.trackers import FrameObservations, FusedFrame
from stseg.trackers.alternative_tracks import AcceptedAlternative, AlternativeTracks
from stseg.trackers.cut import CutTracker
from stseg.tracking.filter.track_filter import TrackFilter

WRONG, RIGHT = (-1.0, 0.5), (-0.3, -0.4)
UNSEEN = FrameObservations((None,) * 4, (None,) * 4)


def explained(standing: People, followed: Alternative | None = None, new: Alternative | None = None) -> Explanation:
    return Explanation(standing, found(people()), (), (), (), np.zeros(4), 0, followed, new)


def read(expected: PredictedTracks | None, gain: float | None, place: tuple[float, float] = RIGHT) -> Explanation:
    """An explanation by a wrong place, and an alternative: by its own tracks, or, without them, one that is found."""
    alternative = Alternative(explained(found(people(place), expected)), gain)
    followed, new = (None, alternative) if expected is None else (alternative, None)
    return explained(found(people(WRONG)), followed, new)


def decided(rate: float, gains: Sequence[float | None]) -> tuple[int, AcceptedAlternative | None]:
    """The frame after which an alternative is no more, -1 for none, and whether it was accepted."""
    tracks, followed = TrackFilter(rate, CONFIG), AlternativeTracks(rate)
    tracks.update(0, found(people(WRONG)), found(people()))
    for frame, gain in enumerate(gains, 1):
        decision = followed.add(frame, read(followed.predict(frame), gain), tracks)
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
        explanation = explained(found(people(WRONG), tracker.predict(frame)))
        if 4 <= frame < 8:
            beside = read(alternative.predict(frame), 6.0)
            explanation = replace(explanation, followed=beside.followed, found=beside.found)
        if (decision := alternative.add(frame, explanation, tracker.filter)) is not None:
            tracker.take(decision)
            explanation = decision.explanation
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


def test_more_evidence_for_another_reading_takes_its_place() -> None:
    tracks, followed = TrackFilter(5.0, CONFIG), AlternativeTracks(5.0)
    tracks.update(0, found(people(WRONG)), found(people()))
    assert followed.add(1, read(None, 4.0), tracks) is None
    for frame, gain, place in ((2, 7.0, RIGHT), (3, 10.0, (0.8, 0.9))):
        explanation = replace(read(followed.predict(frame), 2.0), found=read(None, gain, place).found)
        assert followed.add(frame, explanation, tracks) is None
    expected = followed.predict(4)
    assert expected is not None and np.allclose(expected.ground[0], (0.8, 0.9), atol=0.1)
    decision = followed.add(4, read(expected, 7.0), tracks)
    assert decision is not None and list(decision.readings) == [3]


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


def test_exchanges_that_need_each_other_are_taken_together() -> None:
    """Two ghosts stand where the lines of sight of two people cross: to exchange one alone gains little."""
    cameras = corner_cameras()[:2]
    detector, true = detector_of(rig_of(cameras), "pixels"), np.array([(-0.6, 0.2), (0.9, 0.0)])
    eyes = np.array([camera.centre[:2] for camera in cameras])

    def crossing(first: int, second: int) -> Floats:
        rays = np.array([true[first] - eyes[0], eyes[1] - true[second]]).T
        return np.asarray(eyes[0] + np.linalg.solve(rays, eyes[1] - eyes[0])[0] * rays[:, 0])

    seen = detector.observe(evidence_of("pixels", cameras, people(*true.tolist())))
    prior = Prior.of(None, detector.config, detector.body, detector.border)
    untracked = FrameEvidence(detector.views, seen, prior, detector.parameters, detector.pixel_lattice)
    places = np.array([crossing(0, 1), crossing(1, 0), *true])
    ghosts, both = (Candidates(ground, np.full(2, 1.7), np.full(2, 0.45)) for ground in (places[:2], places[2:]))
    found_best, gain = best_alternative(untracked, ghosts, both), likelihood_gain(untracked, ghosts, both)
    assert found_best is not None and gain is not None and found_best[1] == pytest.approx(gain) and gain > 15.0
    np.testing.assert_array_equal(np.sort(found_best[0].ground, 0), np.sort(true, 0))
    one_exchanged = [ghosts.at([k]).joined_with(both.at([j])) for k in range(2) for j in range(2)]
    alone = [likelihood_gain(untracked, ghosts, mixed) for mixed in one_exchanged]
    assert all(single is not None and single < gain / 3 for single in alone)
