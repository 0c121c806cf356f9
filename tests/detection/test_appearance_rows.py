"""Appearance of detections: the colours of trunk and legs by view, features of boxes, and files of features."""

from pathlib import Path

import numpy as np
from checks import cases, refused
from scenes import boxes, corner_cameras, found, mask, people, rig_of

from stseg.arrays import Boxes, Floats, Observation, Rows, ViewEvidence
from stseg.bodies.pillars import BodyTable
from stseg.detection.appearance import appearance_rows
from stseg.errors import FormatError, SourceError
from stseg.io.detections.source_detections import appearance_axes
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.rig_text import format_rig
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.streams import open_stream
from stseg.records.people import Explanation
from stseg.records.principal_axes import principal_axes
from stseg.records.tables import COLOURS, FEATURES

CAMERAS = corner_cameras()
RIG = rig_of(CAMERAS)
STANDING = people((-1.0, 0.0), (1.0, 0.5))
TABLES = [BodyTable.of(camera, RIG.grid) for camera in CAMERAS]


def explained(step: int = 2) -> Explanation:
    """All people are found, and each pixel of a silhouette is assigned to its person."""
    assignment = []
    for camera in CAMERAS:
        owner = np.full(camera.size[::-1], -1, np.int16)
        for k, person in enumerate(STANDING):
            owner[mask(camera, person[None]) > 0] = k
        assignment.append(owner[::step, ::step])
    person_of_box = tuple(np.arange(len(STANDING)) for _ in CAMERAS)
    crowd = found(STANDING)
    return Explanation(crowd, crowd, tuple(assignment), (step,) * 4, person_of_box, np.zeros(4))


def painted(gain: float = 1.0) -> tuple[list[Observation], list[ViewEvidence]]:
    """Grey rooms in which the first person is bluish, the second reddish, over a light of so much."""
    views: list[Observation] = []
    likely: list[ViewEvidence] = []
    for camera in CAMERAS:
        image = np.full((*camera.size[::-1], 3), 90.0)
        for person, colour in zip(STANDING, ((160, 90, 40), (40, 90, 160)), strict=True):
            image[mask(camera, person[None]) > 0] = colour
        views.append((gain * image).clip(0, 255).astype(np.uint8))
        likely.append((mask(camera, STANDING) > 0).astype(np.float32))
    return views, likely


def rows_of(views: list[Observation], likely: list[ViewEvidence], axes: Floats | None = None) -> Rows:
    return appearance_rows(7, explained(), TABLES, axes, views, likely)


def test_no_people_and_masks_have_no_looks() -> None:
    no_people = found(STANDING[:0])
    empty = tuple(np.full((camera.size[1] // 2, camera.size[0] // 2), -1, np.int16) for camera in CAMERAS)
    explanation = Explanation(no_people, no_people, empty, (2,) * 4, (np.zeros(0, np.int64),) * 4, np.zeros(4))
    assert not len(appearance_rows(0, explanation, TABLES, None, *painted()))
    views, likely = painted()
    assert not len(rows_of([mask(camera, STANDING) for camera in CAMERAS], likely))
    assert not len(rows_of(views, [None] * 4))


def assert_worn(rows: Rows) -> None:
    """Assert that the first person's rows are bluish, the second's reddish, as they are painted."""
    for (x, y, _), blue_to_red in zip(STANDING, (1, -1), strict=True):
        colours = rows["colours"][(rows["x"] == x) & (rows["y"] == y)].reshape(-1, 2, 3)
        assert len(colours) >= 3
        difference = np.log(160 + 16) - np.log(40 + 16)
        np.testing.assert_allclose(colours[..., 0] - colours[..., 2], blue_to_red * difference, atol=0.3)


def test_colours_are_those_that_each_person_wears() -> None:
    rows = rows_of(*painted())
    assert set(rows["frame"].tolist()) == {7} and sorted(set(rows["view"].tolist())) == [0, 1, 2, 3]
    assert_worn(rows)
    assert np.isnan(rows["features"]).all()


def test_gains_are_offsets_and_who_is_covered_has_no_looks() -> None:
    bright, dark = rows_of(*painted()), rows_of(*painted(0.6))
    offset = (bright["colours"] - dark["colours"]).astype(float)
    assert np.ptp(offset) < 0.25 and abs(offset.mean() - np.log(1 / 0.6)) < 0.2
    views, likely = painted()
    hidden = explained()
    hidden.people.found_share[1, 0] = 0.2
    rows = appearance_rows(7, hidden, TABLES, None, views, likely)
    assert not ((rows["view"] == 1) & (rows["x"] == STANDING[0, 0])).any()
    assert ((rows["view"] == 1) & (rows["x"] == STANDING[1, 0])).any()


def test_features_of_boxes_go_to_the_people_whose_boxes_they_are() -> None:
    axes = np.eye(3, 2)
    likely: list[ViewEvidence] = []
    for camera in CAMERAS:
        of_person = boxes(camera, STANDING)
        likely.append(Boxes(of_person.pixel, of_person.score, np.array([[1, 2, 3], [4, 5, 6]], np.float32)))
    rows = rows_of([None] * 4, likely, axes)
    assert len(rows) == 8
    for (x, _, _), features in zip(STANDING, ([1, 2], [4, 5]), strict=True):
        of_person = rows["features"][rows["x"] == x]
        assert (of_person[:, :2] == features).all() and (of_person[:, 2:] == 0).all()
    assert np.isnan(rows["colours"]).all() and not len(rows_of([None] * 4, likely))
    assert rows["features"].shape[1] == FEATURES and rows["colours"].shape[1] == COLOURS


def test_colours_beside_boxes_are_those_of_their_middles() -> None:
    """One person has no box in the third view; what is seen behind people counts nothing."""
    views, _ = painted()
    likely: list[ViewEvidence] = [boxes(camera, STANDING) for camera in CAMERAS]
    explanation = explained(step=1)
    explanation.box_assignment[2][0] = -1
    for assigned in explanation.pixel_assignment:  # outlines of pillars are wider than people
        assigned[assigned < 0] = 0
    rows = appearance_rows(7, explanation, TABLES, None, likely, likely, views)
    assert not ((rows["view"] == 2) & (rows["x"] == STANDING[0, 0])).any()
    assert_worn(rows)
    assert not len(appearance_rows(7, explanation, TABLES, None, likely, likely, [None] * 4))


def source(folder: Path, features: Floats, **more: object) -> Source:
    boxes_at = [(2, 0.9), (0, 0.2), (0, 0.8), (1, 0.7)]
    lines = [f"{frame},{10 * k},5,8,20,{score}\n" for k, (frame, score) in enumerate(boxes_at)]
    (folder / "boxes.csv").write_text("".join(["frame,left,top,width,height,score\n", *lines]))
    np.save(folder / "looks.npy", features)
    return Source("boxes", folder / "boxes.csv", appearance=folder / "looks.npy", **more)  # type: ignore[arg-type]


def test_rows_of_features_are_those_of_the_rig_files_boxes(tmp_path: Path) -> None:
    """Boxes need not be in the order of frames, and some are left out by their scores."""
    stream = open_stream(source(tmp_path, np.arange(4.0)[:, None] + [0, 10], least_score=0.5), CAMERAS[0])
    found = [b for b in iter(stream.read, None) if isinstance(b, Boxes) and b.features is not None]
    assert [b.features.tolist() for b in found] == [[[2, 12]], [[3, 13]], [[0, 10]]]  # type: ignore[union-attr]
    assert [b.pixel[:, 0].tolist() for b in found] == [[20], [30], [0]]
    sources = tuple(CameraSource(source(tmp_path, np.zeros((4, 2)))) for _ in CAMERAS)
    text = format_rig(Recording(tmp_path / "rig.toml", RIG, sources), tmp_path / "rig.toml")
    assert 'appearance = "looks.npy"' in text
    named = [one.source.appearance for one in parse_rig(text, tmp_path / "rig.toml").sources]
    assert named == [tmp_path / "looks.npy"] * 4


@cases()
def test_files_that_are_no_features_are_refused(
    tmp_path: Path, shape: list[int], value: float | str, reported: str
) -> None:
    wanted = source(tmp_path, np.full(shape, value))
    said = refused(FormatError, r"looks\.npy", open_stream, wanted, CAMERAS[0])
    assert reported in said and "\n" not in said


def test_missing_broken_and_unequal_features_are_named(tmp_path: Path) -> None:
    wanted = source(tmp_path, np.zeros((4, 2)))
    (tmp_path / "looks.npy").write_bytes(b"no array")
    refused(FormatError, r"looks\.npy", open_stream, wanted, CAMERAS[0])
    (tmp_path / "looks.npy").unlink()
    refused(SourceError, r"looks\.npy", open_stream, wanted, CAMERAS[0])
    sources = []
    for k in range(4):
        folder = tmp_path / str(k)
        folder.mkdir()
        sources.append(CameraSource(source(folder, np.arange(8.0 + 4 * (k == 3)).reshape(4, -1))))
    three = Recording(tmp_path / "rig.toml", RIG, (*sources[:3], CameraSource(Source("masks", tmp_path / "m.avi"))))
    axes = appearance_axes(three)
    assert axes is not None and axes.shape == (2, 2)
    refused(FormatError, "3 numbers a box", appearance_axes, Recording(tmp_path / "rig.toml", RIG, tuple(sources)))
    assert appearance_axes(Recording(tmp_path / "rig.toml", RIG, three.sources[3:] * 4)) is None


def test_axes_are_those_of_the_greatest_variance() -> None:
    rng = np.random.default_rng(2)
    spread = np.zeros(40)
    spread[[3, 17]] = 5.0, 2.0
    samples = [(rng.normal(size=(200, 40)) * (spread + 0.1) + 100 * k).astype(np.float32) for k in range(3)]
    axes = principal_axes(samples, FEATURES)
    assert axes.shape == (40, FEATURES)
    np.testing.assert_allclose(axes.T @ axes, np.eye(FEATURES), atol=1e-9)
    assert axes[3, 0] > 0.99 and axes[17, 1] > 0.99
