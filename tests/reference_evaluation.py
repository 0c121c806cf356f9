"""Slow plain definitions of the scores: dictionaries, loops, and every possible matching tried."""

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from stseg.arrays import Rows

Place = tuple[float, float]
Scene = list[tuple[dict[int, Place], dict[int, Place]]]
"""For each frame where the people and where the tracks are."""
Matching = dict[int, int]


def scene_of(truth: Rows, tracks: Rows) -> Scene:
    """Both tables by frame; the frames are those of the truth."""

    def places(rows: Rows, frame: int) -> dict[int, Place]:
        return {int(r["id"]): (float(r["x"]), float(r["y"])) for r in rows if r["frame"] == frame}

    return [(places(truth, frame), places(tracks, frame)) for frame in sorted(set(truth["frame"].tolist()))]


def matchings(people: list[int], tracks: list[int]) -> Iterator[Matching]:
    """Every way to give some of the people a track of their own."""
    if not people:
        yield {}
        return
    for rest in matchings(people[1:], tracks):
        yield rest
        for track in tracks:
            if track not in rest.values():
                yield {people[0]: track, **rest}


def best(people: dict[int, Place], tracks: dict[int, Place], gate: float, before: Matching) -> Matching:
    """Most pairs kept from before, then most pairs, then least distance."""

    def worth(matching: Matching) -> tuple[float, float, float]:
        distances = [math.dist(people[p], tracks[t]) for p, t in matching.items()]
        if any(distance > gate for distance in distances):
            return -1, 0, 0
        return sum(before.get(p) == t for p, t in matching.items()), len(distances), -sum(distances)

    return max(matchings(list(people), list(tracks)), key=worth)


def clear(scene: Scene, gate: float) -> dict[str, float]:
    """Counts of CLEAR and of detection."""
    counts: Counter[str] = Counter()
    before: Matching = {}
    last: Matching = {}
    person_frames, hit, track_seen, track_hit = Counter[int](), Counter[int](), Counter[int](), Counter[int]()
    for people, tracks in scene:
        counts["TP"] += len(best(people, tracks, gate, {}))
        now = best(people, tracks, gate, before)
        for person, track in now.items():
            counts["IDSW"] += person in last and last[person] != track
            counts["Frag"] += person in last and person not in before
            counts["kept"] += 1
        person_frames.update(people.keys())
        hit.update(now.keys())
        track_seen.update(tracks.keys())
        track_hit.update(now.values())
        last |= now
        before = now
    counts["MT"] = sum(hit[p] / person_frames[p] > 0.8 for p in person_frames)
    counts["ML"] = sum(hit[p] / person_frames[p] < 0.2 for p in person_frames)
    counts["false_tracks"] = sum(track_hit[t] <= track_seen[t] / 2 for t in track_seen)
    return {name: counts[name] for name in ("TP", "kept", "IDSW", "Frag", "MT", "ML", "false_tracks")}


def hota(scene: Scene, radius: float) -> float:
    """HOTA as Luiten et al. write it: for every true positive c, A(c) = TPA / (TPA + FNA + FPA)."""
    person_frames = Counter(p for here, _ in scene for p in here)
    found = Counter(t for _, tracks_here in scene for t in tracks_here)
    if not (person_frames and found):
        return 0.0
    alikes = [
        {(p, t): max(0.0, 1 - math.dist(here[p], tracks_here[t]) / radius) for p in here for t in tracks_here}
        for here, tracks_here in scene
    ]
    agreed = Counter[tuple[int, int]]()  # floats, but Counter's zero for what is missing serves
    for alike in alikes:
        for (p, t), value in alike.items():
            rivals = sum(v for (q, u), v in alike.items() if q == p or u == t)
            agreed[p, t] += value / rivals if rivals else 0  # type: ignore[assignment]
    matched = []
    for (here, tracks_here), alike in zip(scene, alikes, strict=True):

        def worth(matching: Matching, alike: dict[tuple[int, int], float] = alike) -> float:
            return sum(
                alike[pair] * agreed[pair] / (person_frames[pair[0]] + found[pair[1]] - agreed[pair])
                for pair in matching.items()
            )

        chosen = max(matchings(list(here), list(tracks_here)), key=worth)
        matched += [(pair, alike[pair]) for pair in chosen.items()]
    scores = []
    for alpha in np.arange(0.05, 0.99, 0.05):
        true = [pair for pair, value in matched if value >= alpha]
        tpa = Counter(true)
        association = sum(tpa[p, t] / (person_frames[p] + found[t] - tpa[p, t]) for p, t in true)
        union = person_frames.total() + found.total() - len(true)
        scores.append(math.sqrt(association / union))  # DetA AssA = (TP / union) (association / TP)
    return sum(scores) / len(scores)
