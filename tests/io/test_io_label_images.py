"""Label images on disk, and the command that writes them."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from checks import Command, refused
from run_files import write_run
from scenes import box_frame_sets, looking, mask_frame_sets, rig_of, standing_at, walkers

from stseg.arrays import Boxes, Bytes
from stseg.commands.main import main
from stseg.config import LabelConfig
from stseg.errors import OutputError
from stseg.geometry import Rig
from stseg.io.outputs.label_images import LabelImages
from stseg.io.outputs.whole_files import Inputs
from stseg.io.recording.recording import CameraSource, Recording, Source
from stseg.io.recording.streams import open_images

PALETTE = np.random.default_rng(0).integers(0, 256, (256, 3)).astype(np.uint8)
FRAMES = 4


def two_cameras() -> Rig:
    return rig_of([looking("west", (-3.5, -3.5, 2.6)), looking("east", (3.5, -3.4, 2.6))])


def run_of(path: Path, sources: tuple[CameraSource, ...], config: str = "") -> Path:
    recording = Recording(path.with_name("rig.toml"), two_cameras(), sources)
    return write_run(path, recording, walkers(FRAMES), np.arange(FRAMES), config)


def mask_sources(folder: Path, frames: int = FRAMES, instances: bool = False) -> tuple[CameraSource, ...]:
    sources, frame_sets = [], list(mask_frame_sets(two_cameras(), walkers(FRAMES), 0, frames))
    for k, camera in enumerate(two_cameras().cameras):
        own = folder / f"{camera.name}_seen"
        own.mkdir()
        for frame_set in frame_sets:
            seen = np.asarray(frame_set.views[k], np.uint8)
            cv2.imwrite(str(own / f"{frame_set.frame:03d}.png"), seen // 100 if instances else seen)
        sources.append(CameraSource(Source("instances" if instances else "masks", own)))
    return tuple(sources)


def read(folder: Path, camera: str) -> list[Bytes]:
    (own,) = [camera_ for camera_ in two_cameras().cameras if camera_.name == camera]
    stream = open_images(Source("instances", folder / camera), own, 1)
    images = []
    while (image := stream.read()) is not None:
        images.append(np.asarray(image))
    return images


@pytest.fixture
def run_path(tmp_path: Path) -> Path:
    return run_of(tmp_path / "run.h5", mask_sources(tmp_path))


@pytest.mark.parametrize(("largest", "kind"), [(255, 3), (256, 0)])
def test_ids_are_read_back_and_the_kind_is_that_of_the_largest(tmp_path: Path, largest: int, kind: int) -> None:
    images = LabelImages(tmp_path / "out", ["west"], largest, PALETTE, overwrite=False)
    ids = np.random.default_rng(1).integers(0, largest + 1, (96, 128))
    images.write("west", 7, ids)
    (path,) = (tmp_path / "out" / "west").iterdir()
    assert path.name == "000007.png"
    assert path.read_bytes()[25] == kind  # the colour type of the header: 3 indexed, 0 grey
    np.testing.assert_array_equal(read(tmp_path / "out", "west")[0], ids)
    shown = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert shown is not None
    colours = PALETTE[ids] if kind == 3 else np.dstack([ids // 256] * 3)  # 16 bits are shown by their upper half
    np.testing.assert_array_equal(shown[..., ::-1], colours)


def test_old_images_go_but_foreign_read_and_unwritable_stay(tmp_path: Path) -> None:
    images = LabelImages(tmp_path / "out", ["west"], 3, PALETTE, overwrite=False)
    images.write("west", 99, np.zeros((4, 4), np.int64))
    refused(OutputError, "files in it", LabelImages, tmp_path / "out", ["west"], 3, PALETTE, overwrite=False)
    LabelImages(tmp_path / "out", ["west"], 3, PALETTE, overwrite=True)
    assert not list((tmp_path / "out" / "west").iterdir())
    refused(OutputError, "65536", LabelImages, tmp_path / "out", ["west"], 65536, PALETTE, overwrite=False)
    refused(OutputError, "camera", LabelImages, tmp_path / "out", ["../west"], 3, PALETTE, overwrite=False)
    (tmp_path / "file").write_text("")
    refused(OutputError, "found", LabelImages, tmp_path / "file" / "out", ["west"], 3, PALETTE, overwrite=False)
    # Sources are often called as label images are: images/CAMERA/000000.png.
    out = (tmp_path / "out", ["east", "west"], 3, PALETTE, True)
    LabelImages(*out).write("east", 0, np.zeros((4, 4), np.int64))
    (made,) = (tmp_path / "out" / "east").iterdir()
    refused(OutputError, "a file that is read here", LabelImages, *out, Inputs([made]))
    cv2.imwrite(str(tmp_path / "out" / "west" / "000000.png"), np.zeros((4, 4), np.uint8))
    refused(OutputError, r"000000\.png: found a file that stseg did not make", LabelImages, *out)
    assert made.exists()
    assert (tmp_path / "out" / "west" / "000000.png").exists()


def test_every_frame_has_an_image_of_ids_of_instances_too(run_path: Path, tmp_path: Path) -> None:
    assert main(["labels", str(run_path), "-o", str(tmp_path / "out")]) == 0
    for camera in two_cameras().cameras:
        images = read(tmp_path / "out", camera.name)
        assert len(images) == FRAMES
        for frame, image in enumerate(images):
            assert set(np.unique(image)) <= {0, 11, 12, 13}
            for (x, y, height), identity in zip(standing_at(walkers(FRAMES), frame), (11, 12, 13), strict=True):
                pixel, _ = camera.project(np.array([x, y]), 0.6 * height)
                if camera.inside(pixel):
                    assert image[round(float(pixel[1])), round(float(pixel[0]))] == identity
    folder = tmp_path / "instances"
    folder.mkdir()
    path = run_of(folder / "run.h5", mask_sources(folder, instances=True))
    for source, out in ((run_path, "masks_out"), (path, "instances_out")):
        assert main(["labels", str(source), "-o", str(tmp_path / out)]) == 0
    ours, theirs = (np.stack(read(tmp_path / out, "west")) for out in ("masks_out", "instances_out"))
    assert ((ours != theirs).mean(axis=(1, 2)) < 0.01).all()


def test_frames_keep_their_numbers_and_their_labels(run_path: Path, tmp_path: Path) -> None:
    whole, part = tmp_path / "whole", tmp_path / "part"
    assert main(["labels", str(run_path), "-o", str(whole)]) == 0
    (part / "east").mkdir(parents=True)
    for name in ("000001.png.0123456789abcdef.part", "mine.part"):  # the first one is of a killed command
        (part / "east" / name).touch()
        os.utime(part / "east" / name, (0, 0))
    assert main(["labels", str(run_path), "-o", str(part), "--frames", "2:", "--overwrite"]) == 0
    assert sorted(path.name for path in (part / "east").iterdir()) == ["000002.png", "000003.png", "mine.part"]
    for path in part.glob("*/*.png"):
        assert path.read_bytes() == (whole / path.parent.name / path.name).read_bytes()


def test_boxes_have_no_label_images_and_blind_views_no_labels(tmp_path: Path) -> None:
    masks, _ = mask_sources(tmp_path, 2)
    masks = CameraSource(masks.source, on_missing="blind")
    path = run_of(tmp_path / "run.h5", (masks, box_source(tmp_path / "east.csv")))
    assert main(["labels", str(path), "-o", str(tmp_path / "out")]) == 0
    assert [folder.name for folder in (tmp_path / "out").iterdir()] == ["west"]
    assert [image.any() for image in read(tmp_path / "out", "west")] == [True, True, False, False]


def test_the_constants_are_those_of_the_run_but_for_what_is_set(tmp_path: Path) -> None:
    sources = mask_sources(tmp_path)
    wide = run_of(tmp_path / "wide.h5", sources, "[labels]\nposition_noise = 0.5\n")
    plain = run_of(tmp_path / "plain.h5", sources)
    narrow = ("--set", f"labels.position_noise={LabelConfig().position_noise}")
    for path, options in ((wide, ()), (wide, narrow), (plain, ())):
        out = str(tmp_path / f"{path.stem}{len(options)}")
        assert main(["labels", str(path), "-o", out, "--frames", "0:1", *options]) == 0
    own, back, default = (read(tmp_path / name, "west")[0] for name in ("wide0", "wide2", "plain0"))
    np.testing.assert_array_equal(back, default)
    assert (own != default).any()


def box_source(path: Path) -> CameraSource:
    lines = ["frame,left,top,width,height"]
    for frame_set in box_frame_sets(two_cameras(), walkers(FRAMES), 0, FRAMES):
        found = frame_set.views[1]
        assert isinstance(found, Boxes)
        lines += [f"{frame_set.frame},{','.join(map(str, box))}" for box in found.pixel.tolist()]
    path.write_text("\n".join(lines) + "\n")
    return CameraSource(Source("boxes", path, frames=FRAMES))


def test_what_the_user_can_mend_is_said(tmp_path: Path, refusal: Command, run_path: Path) -> None:
    boxes = tmp_path / "boxes"
    boxes.mkdir()
    path = run_of(boxes / "run.h5", (box_source(boxes / "east.csv"),) * 2)
    said = "found boxes alone, expected a camera that delivers pixels"
    assert said in refusal("labels", path, "-o", tmp_path / "out")
    assert "--frames" in refusal("labels", run_path, "-o", tmp_path / "out", "--frames", "3:9")
    assert "labels.samples: found 0" in refusal("labels", run_path, "-o", tmp_path / "out", "--set", "labels.samples=0")
    assert not (tmp_path / "out").exists()
