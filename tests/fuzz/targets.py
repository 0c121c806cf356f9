"""One target for each parser and reader: a folder with the file, and the call that reads it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from run_files import small_trajectory, write_small_run

from fuzz import corpus
from fuzz.corpus import BOXES
from fuzz.detection_targets import CAMERA, DETECTION_TARGETS, frames
from fuzz.mutations import mutated_objects
from fuzz.target import Target, plain
from stseg.calibration.points.point_fit import Points, fit_points
from stseg.commands.calibrate.page import calibrate_page
from stseg.commands.correct import correct
from stseg.commands.measure import measure
from stseg.commands.review import review
from stseg.identities.review.corrections import ACTIONS, Answer, solve_corrections
from stseg.io.answers import read_answers, read_names
from stseg.io.areas import read_lines, read_polygons
from stseg.io.calibrations.formats import FORMATS, ImportOptions, read_cameras
from stseg.io.calibrations.point_files import read_points
from stseg.io.config_file import read_config
from stseg.io.exports import formats as exports
from stseg.io.live.arriving_files import FileNotes
from stseg.io.live.live_tables import CorrectionTable, LiveTable
from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.pictures import read_picture
from stseg.io.recording.recording import Source
from stseg.io.recording.rigs import parse_rig, read_recording
from stseg.io.recording.video.video_stream import VideoStream
from stseg.io.runfile.runs import read_run
from stseg.io.runfile.unfinished.work_folder import WorkFolder
from stseg.io.track_csv import read_tracks_csv
from stseg.measures.areas import Line, Zone
from stseg.records.tables import Tracks

_GROUND = np.array([[0.1, 0.1], [0.3, 0.2], [5.0, 5.0]])
OPTIONS = ImportOptions((64, 48), "m", 1.75)


def _importer(format: str) -> Callable[[Path], object]:
    return lambda path: read_cameras(format, [path], OPTIONS)


def _video(path: Path) -> None:
    stream = VideoStream(Source("video", path), CAMERA)
    stream.times()
    stream.close()
    frames("video")(path)


def _picture(path: Path) -> None:
    read_picture(path, "images", (64, 48), "")


def _run(path: Path) -> None:
    run = read_run(path)
    assert isinstance(run.names, dict)
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
    answers.write_bytes(corpus.ANSWERS)
    with redirect_stdout(StringIO()):
        review(path, output=path.with_name("review.html"), overwrite=True)
        measure(path, output=path.with_name("measures"), overwrite=True)
        correct(path, answers, output=path.with_name("corrected.h5"), overwrite=True)


def _streams(path: Path) -> None:
    rig = path.with_name("rig.toml")
    rig.write_bytes(corpus.RIG)
    path.with_name("boxes.csv").write_bytes(BOXES)
    with WorkFolder(path.with_name("q.h5"), {}) as work:
        (work.path / "streams.npz").write_bytes(path.read_bytes())
        work.streams(read_recording(rig))


def _begun(path: Path) -> None:
    with WorkFolder(path.with_name("q.h5"), {"config": {"a": 1}, "rig": {"b": "c"}}) as work:
        (work.path / "begun.json").write_bytes(path.read_bytes())
    with WorkFolder(path.with_name("q.h5"), {"config": {"a": 1}, "rig": {"b": "c"}}):
        pass


def _live_table(path: Path) -> None:
    copy = path.with_name("live.csv")
    copy.write_bytes(path.read_bytes())
    with LiveTable(copy, 10.0, 5):
        pass


def _live_corrections(path: Path) -> None:
    copy = path.with_name("live_corrections.csv")
    copy.write_bytes(path.read_bytes())
    CorrectionTable(copy, 90)


def _small_run(folder: Path) -> bytes:
    """A run with names."""
    answers, output = folder / "answers.csv", folder / "corrected.h5"
    answers.write_bytes(corpus.ANSWERS)
    with redirect_stdout(StringIO()):
        correct(write_small_run(folder / "small.h5", overwrite=True), answers, output=output, overwrite=True)
    return output.read_bytes()


def _small_run_beside(path: Path) -> Path:
    run = path.with_name("small.h5")
    return run if run.exists() else write_small_run(run)


def _zones(path: Path) -> None:
    for name, rings in read_polygons(path):
        zone = Zone(name, rings)
        zone.contains(_GROUND)
        assert np.isfinite(zone.area)


def _lines(path: Path) -> None:
    for name, (points,) in read_lines(path):
        assert np.isfinite(Line(name, points).distance(_GROUND)).all()


def _answers(path: Path) -> None:
    rows = read_answers(path, ACTIONS)
    answers = [Answer(row.place, row.action, row.track, row.other, row.frame, row.name) for row in rows]
    solve_corrections(Tracks(small_trajectory()).summary(), answers)


def _names(path: Path) -> None:
    run = read_run(_small_run_beside(path)).with_names(read_names(path))
    with replacing(path.with_name("out"), overwrite=True) as part:
        exports.write_tracks("geojson", part, run)


def _points(path: Path) -> None:
    for table in read_points(path):
        fit_points(table.camera, (64, 48), Points(table.pixel, table.place[:, :2], table.place[:, 2]), None)


def _calibration_page(path: Path) -> None:
    with redirect_stdout(StringIO()):
        calibrate_page(path, output=path.with_name("page.html"), area="0,0,4,3", plan=path, overwrite=True)


TARGETS = (
    *DETECTION_TARGETS,
    Target("rig.toml", plain(corpus.RIG), lambda path: parse_rig(path.read_text("utf-8", "replace"), path)),
    Target("rig_file.toml", plain(corpus.RIG), read_recording),
    Target("config.toml", plain(corpus.CONFIG), read_config),
    Target("tracks.csv", plain(corpus.TRACKS), read_tracks_csv),
    Target("points.csv", plain(corpus.POINTS), read_points),
    Target("eight_points.csv", plain(corpus.EIGHT_POINTS), _points),
    Target("zones.geojson", plain(corpus.ZONES), _zones),
    Target("lines.geojson", plain(corpus.LINES), _lines),
    Target("answers.csv", plain(corpus.ANSWERS), _answers),
    Target("names.csv", plain(corpus.NAMES), _names),
    Target("floor_plan.png", lambda _: corpus.floor_plan(".png"), _calibration_page),
    Target("floor_plan.jpg", lambda _: corpus.floor_plan(".jpg"), _calibration_page),
    Target("matrix.txt", plain(corpus.NUMBERS), _importer("matrix")),
    Target("matrix.npy", lambda _: corpus.npy(), _importer("matrix")),
    Target("matrix.npz", lambda _: corpus.npz(), _importer("matrix")),
    Target("matrix.mat", lambda _: corpus.mat(), _importer("matrix")),
    Target("matrix_hdf5.mat", corpus.matlab_hdf5, _importer("matrix")),
    Target("opencv.xml", plain(corpus.OPENCV), _importer("opencv")),
    Target("tsai.xml", plain(corpus.TSAI), _importer("tsai")),
    Target("pom.txt", plain(corpus.POM), _importer("pom")),
    Target("krt.json", plain(corpus.KRT), _importer("krt")),
    Target("poses.toml", plain(corpus.POSES), _importer("anipose")),
    Target("nvidia.json", plain(corpus.NVIDIA), _importer("nvidia")),
    Target("kalibr.yaml", plain(corpus.KALIBR), _importer("kalibr")),
    Target("run.h5", _small_run, _run),
    Target("run_objects.h5", _small_run, _used_run, mutated_objects),
    Target("streams.npz", lambda _: corpus.npz(), _streams),
    Target("begun.json", plain(corpus.BEGUN), _begun),
    Target("files.json", plain(corpus.NOTES), FileNotes),
    Target("live.table.csv", plain(corpus.LIVE_TABLE), _live_table),
    Target("live.corrections.csv", plain(corpus.LIVE_CORRECTIONS), _live_corrections),
    Target("indexed.png", lambda _: corpus.png(True), lambda path: read_picture(path, "instances", (64, 48), "")),
    Target("grey.png", lambda _: corpus.png(False), lambda path: read_picture(path, "instances", (64, 48), "")),
    Target("mask.png", lambda _: corpus.png(True), lambda path: read_picture(path, "masks", (64, 48), "")),
    *(
        Target(f"colour{suffix}", plain(corpus.picture(suffix)), _picture)
        for suffix in (".png", ".jpg", ".bmp", ".tiff", ".webp")
    ),
    Target("mjpeg.avi", lambda folder: corpus.video(folder, ".avi", "MJPG"), _video),
    Target("mpeg4.mp4", lambda folder: corpus.video(folder, ".mp4", "mp4v"), _video),
)  # fmt: skip
"""All of them."""

assert {"opencv", "tsai", "pom", "krt", "anipose", "nvidia", "kalibr", "matrix"} <= set(FORMATS)
