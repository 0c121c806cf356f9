"""One target for each parser and reader: a valid file, and the call that reads it."""

import json
import re
import shutil
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import partial
from io import StringIO
from itertools import takewhile
from pathlib import Path

import numpy as np
from run_files import small_trajectory, write_small_run

from fuzz import corpus, oracles
from fuzz.corpus import GREY, RAMP, Maker, encoded, text
from fuzz.mutations import mutated, mutated_objects
from stseg import Boxes, Camera, Source, StsegError, read_config, read_recording, read_run, read_tracks_csv
from stseg.calibration.points.camera_models import Points
from stseg.calibration.points.point_fit import fit_points
from stseg.commands.calibrate.page import calibrate_page
from stseg.commands.correct import correct
from stseg.commands.measure import measure
from stseg.commands.review import review
from stseg.geometry import Grid
from stseg.identities.review.corrections import ACTIONS, Answer, solve_corrections
from stseg.io.answers import read_answers, read_names
from stseg.io.areas import read_lines, read_polygons
from stseg.io.calibrations.formats import FORMATS, ImportOptions, read_cameras
from stseg.io.calibrations.point_files import read_points
from stseg.io.exports import formats as exports
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.live_tables import CorrectionTable, LiveTable
from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.aligned_stream import index_streams
from stseg.io.recording.pictures import read_picture
from stseg.io.recording.recording import SourceKind
from stseg.io.recording.rigs import parse_rig
from stseg.io.recording.streams import open_stream
from stseg.io.recording.video.video_stream import VideoStream
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.io.untrusted import limits
from stseg.measures.areas import Line, Zone
from stseg.records.tables import Tracks

Reader = Callable[[Path], object]


@dataclass(frozen=True)
class Target:
    """A reader that is fuzzed."""

    name: str
    """Of the target; its suffix is that of the file."""
    read: Reader
    """Reads a file; raises StsegError for what it does not take."""
    make: Maker | None = None
    """Makes a valid file, which `read` takes without an error; the text of the target's name where it is None."""
    mutate: Callable[[bytes, np.random.Generator], bytes] = mutated
    """Makes another file of a valid one."""

    @property
    def suffix(self) -> str:
        """Of its files."""
        return Path(self.name).suffix

    def valid(self, folder: Path) -> bytes:
        """The valid file."""
        return text(self.name) if self.make is None else self.make(folder)


def answer(target: Target, path: Path, valid: bytes = b"") -> str:
    """The answer to a file: nothing, or one line; anything else than StsegError is raised."""
    try:
        target.read(path)
        if (target.suffix == ".csv" and not target.name.startswith("live")) or target.name == "mot.txt":
            oracles.require_table(path, -limits.FRAMES if target.name == "tracks.csv" else 0)
    except StsegError as error:
        oracles.require_line(error, Path() if target.read is _points else path.parent)  # arrays have no file
        if (target.suffix == ".csv" and target.read is not _points) or target.name.startswith("mot"):
            oracles.require_place(error, valid, path.read_bytes())
        return str(error)
    return ""


SIZE = (64, 48)
CAMERA = Camera("cam1", SIZE, np.eye(3), np.array([0.0, 0.0, -1.0]))
OPTIONS = ImportOptions(SIZE, "m", 1.75)
_GROUND = np.array([[0.1, 0.1], [0.3, 0.2], [5.0, 5.0]])
_GRID = Grid((0.0, 6.0), (0.0, 6.0))
_FRAMES, _NOTES = 20, {"config": {"a": 1}, "rig": {"b": "c"}}


def _frames_of(source: Source, most: float = limits.NUMBER) -> None:
    """Read the first frames, and what was accepted once more."""
    stream = open_stream(source, CAMERA)
    views = list(takewhile(lambda view: view is not None, (stream.read() for _ in range(_FRAMES))))
    stream.close()
    assert views, "a source that shows nothing"
    if source.path.suffix == ".json":
        oracles.require_json(json.loads(source.path.read_text("utf-8-sig")), CAMERA.size)
    oracles.require_boxes([view for view in views if isinstance(view, Boxes)], CAMERA, source.path.parent, most)


def _frames(kind: SourceKind) -> Reader:
    return lambda path: _frames_of(Source(kind, path))


def _mapped(path: Path) -> None:
    _frames_of(Source("boxes", path, columns=(("frame", "t"), ("left", "x1"), ("score", "conf")), classes=("person",)))


def _images_of_coco(path: Path) -> None:
    results = path.with_name("results.json")
    results.write_bytes(text("coco.json"))
    _frames_of(Source("boxes", results, image_list=path, select="a_*"))


def _in_folder(name: str, kind: SourceKind = "boxes", first: str = "", view: int | None = None) -> Reader:
    """The file as one of a folder, under a name that numbers a frame; the text of that name may lie beside it."""

    def read(path: Path) -> None:
        folder = path.with_name("frames")
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        if first:
            (folder / "a_0.txt").write_bytes(text(first))
        (folder / name).write_bytes(path.read_bytes())
        shares = name.endswith(".txt")  # of an image, so that no box is far beyond it
        _frames_of(replace(Source(kind, folder), view=view), 3 * max(SIZE) if shares else limits.NUMBER)

    return read


def _cameras(format: str, path: Path) -> None:
    oracles.require_cameras(read_cameras(format, [path], OPTIONS), path)


def _picture(kind: SourceKind) -> Reader:
    return lambda path: read_picture(path, kind, SIZE, "")


def _video(path: Path) -> None:
    stream = VideoStream(Source("video", path), CAMERA)
    stream.times()
    stream.close()
    _frames("video")(path)


def _run(path: Path) -> None:
    run = read_run(path)
    run.require_consistency()
    oracles.require_run(run)
    for table in ("tracks", "events", "ghosts", "windows", "rates", "shifts", "timings", "committed", "appearance"):
        getattr(run, table)
    for frame in run.frames[:2].tolist():
        run.read_frame(frame)
    for to in ("csv", "jupedsim", "wildtrack", "mot-boxes", "geojson", "mf-json"):
        with replacing(path.with_name("out"), overwrite=True) as part:
            exports.write_tracks(to, part, run)


def _used_run(path: Path) -> None:
    """Commands that use its tables together; `report` takes too long here."""
    _run(path)
    answers = path.with_name("answers.csv")
    answers.write_bytes(text("answers.csv"))
    with redirect_stdout(StringIO()):
        review(path, output=path.with_name("review.html"), overwrite=True)
        measure(path, output=path.with_name("measures"), overwrite=True)
        correct(path, answers, output=path.with_name("corrected.h5"), overwrite=True)


def _streams(path: Path) -> None:
    rig = path.with_name("rig.toml")
    rig.write_bytes(text("rig.toml"))
    path.with_name("boxes.csv").write_bytes(text("boxes.csv"))
    with WorkFolder(path.with_name("q.h5"), {}) as work:
        (work.path / "streams.npz").write_bytes(path.read_bytes())
        found = work.streams(recording := read_recording(rig))
    assert found is None or found.length == index_streams(recording).length


def _begun(path: Path) -> None:
    with WorkFolder(path.with_name("q.h5"), _NOTES) as work:
        (work.path / "begun.json").write_bytes(path.read_bytes())
    with WorkFolder(path.with_name("q.h5"), _NOTES):
        assert json.loads(path.read_text("utf-8-sig")) == _NOTES


def _live_table(path: Path) -> None:
    with LiveTable(Path(shutil.copy(path, path.with_name("live.csv"))), 10.0, 5):
        pass


def _zones(path: Path) -> None:
    oracles.require_areas(zones := read_polygons(path))
    for zone in (Zone(name, rings) for name, rings in zones):
        assert zone.contains(_GROUND).shape == (len(_GROUND),)
        assert np.isfinite(zone.area_on(_GRID))


def _lines(path: Path) -> None:
    oracles.require_areas(lines := read_lines(path))
    for name, (points,) in lines:
        assert np.isfinite(Line(name, points).distance(_GROUND)).all()


def _answers(path: Path) -> None:
    oracles.require_answers(rows := read_answers(path, ACTIONS))
    answers = [Answer(row.place, row.action, row.track, row.other, row.frame, row.name) for row in rows]
    solve_corrections(Tracks(small_trajectory()).summary(), answers)


def _names(path: Path) -> None:
    small, names = path.with_name("small.h5"), read_names(path)
    assert len(names) == len(oracles.rows_of(path)) - 1
    run = read_run(small if small.exists() else write_small_run(small)).with_names(names)
    with replacing(path.with_name("out"), overwrite=True) as part:
        exports.write_tracks("geojson", part, run)


def _points(path: Path) -> None:
    oracles.require_points(tables := read_points(path))
    for table in (one for one in tables if len(one.pixel) < 1_000):  # more take longer than a file may here
        fit_points(table.camera, SIZE, Points(table.pixel, table.place[:, :2], table.place[:, 2]), None)


def _calibration_page(path: Path) -> None:
    with redirect_stdout(StringIO()):
        calibrate_page(path, output=path.with_name("page.html"), area="0,0,4,3", plan=path, overwrite=True)


_CALIBRATIONS: dict[str, Maker | None] = {
    **dict.fromkeys(("matrix.txt", "opencv.xml", "tsai.xml", "pom.txt", "krt.json", "nvidia.json")),
    **dict.fromkeys(("anipose.toml", "kalibr.yaml")),
    "matrix.npy": corpus.npy,
    "matrix.npz": corpus.npz,
    "matrix_hdf5.mat": corpus.matlab_hdf5,
    "matrix.mat": lambda _: corpus.mat_file(),
}
"""Files of foreign calibrations, named as their formats."""
_BOXES = ("mot.txt", "mot_truth.txt", "yolo.jsonl", "mmdetection.json", "coco.json", "label_studio_video.json")
_INSTANCES = ("yolo.json", "coco_data.json", "cvat.xml", "cvat_images.xml", "label_studio.json", "via.json")
TARGETS = (
    *(Target(name, _frames("boxes")) for name in _BOXES),
    *(Target(name, _frames("instances")) for name in _INSTANCES),
    Target("boxes.csv", _frames("boxes")),
    Target("mapped.csv", _mapped),
    Target("boxes.parquet", _frames("boxes"), corpus.parquet),
    Target("yolo.txt", _in_folder("a_1.txt", "boxes", "yolo.txt")),
    Target("yolo_outlines.txt", _in_folder("a_1.txt", "instances")),
    Target("yolo_names.yaml", _in_folder("data.yaml", "boxes", "yolo.txt")),
    Target("yolo_frame.json", _in_folder("a_1.json")),
    Target("mmdetection_frame.json", _in_folder("a_1.json", "instances")),
    Target("wildtrack.json", _in_folder("00000005.json", view=0)),
    Target("coco_images.json", _images_of_coco, lambda _: text("coco_data.json")),
    Target("rig.toml", lambda path: oracles.require_rig(parse_rig(path.read_text("utf-8", "replace"), path), path)),
    Target("rig_file.toml", lambda path: oracles.require_rig(read_recording(path), path), lambda _: text("rig.toml")),
    Target("config.toml", lambda path: oracles.require_config(read_config(path), path)),
    Target("tracks.csv", lambda path: oracles.require_tracks(read_tracks_csv(path), path.parent)),
    Target("points.csv", lambda path: oracles.require_points(read_points(path))),
    Target("eight_points.csv", _points),
    Target("zones.geojson", _zones),
    Target("lines.geojson", _lines),
    Target("answers.csv", _answers),
    Target("names.csv", _names),
    *(Target(f"floor_plan{suffix}", _calibration_page, encoded(suffix, GREY)) for suffix in (".png", ".jpg")),
    *(Target(name, partial(_cameras, re.split("[._]", name)[0]), make) for name, make in _CALIBRATIONS.items()),
    Target("run.h5", _run, corpus.small_run),
    Target("run_tables.h5", _run, corpus.small_run, mutated_objects),
    Target("run_objects.h5", _used_run, corpus.small_run, mutated_objects),
    Target("streams.npz", _streams, corpus.streams),
    Target("begun.json", _begun),
    Target("files.json", FileNotes),
    Target("live.table.csv", _live_table),
    Target("live.corrections.csv", lambda path: CorrectionTable(Path(shutil.copy(path, path.with_name("copy"))), 90)),
    Target("indexed.png", _picture("instances"), corpus.indexed_png),
    Target("grey.png", _picture("instances"), corpus.grey_png),
    Target("mask.png", _picture("masks"), corpus.indexed_png),
    *(Target(f"colour{suffix}", _picture("images"), encoded(suffix, RAMP))
      for suffix in (".png", ".jpg", ".bmp", ".tiff", ".webp")),
    Target("mjpeg.avi", _video, corpus.video(".avi", "MJPG")),
    Target("mpeg4.mp4", _video, corpus.video(".mp4", "mp4v")),
)  # fmt: skip
"""All of them."""

assert {re.split("[._]", name)[0] for name in _CALIBRATIONS} <= set(FORMATS)
