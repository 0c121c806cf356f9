"""Detectors in ONNX files, by small models of known output; the detector by oriented gradients, by OpenCV 4."""

import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import cv2
import detector_models
import numpy as np
import onnx
import pytest
from checks import cases, data_path, refused, tables
from detector_models import HEIGHT, MODELS, WIDTH

from stseg.errors import FormatError, InputError, SourceError
from stseg.io.detectors.feature_model import FeatureModel
from stseg.io.detectors.hog import HogDetector, window_margins
from stseg.io.detectors.layouts import LAYOUTS
from stseg.io.detectors.onnx_header import parse_header
from stseg.io.detectors.people_detector import OnnxDetector
from stseg.io.detectors.picture_fit import fit_picture

RED, BLUE = (0, 0, 255), (255, 0, 0)
LIBRARIES = pytest.mark.parametrize("by_opencv", [True] + [False] * (find_spec("onnxruntime") is not None))
CASES = [(name, build) for name, builds in MODELS.items() for build in builds]


def picture(size: tuple[int, int], *rectangles: tuple[tuple[int, int, int, int], tuple[int, int, int]]) -> np.ndarray:
    """A grey picture of `size` (width, height) with rectangles (left, top, right, bottom) of colours."""
    image = np.full((size[1], size[0], 3), 100, np.uint8)
    for (left, top, right, bottom), colour in rectangles:
        image[top:bottom, left:right] = colour
    return image


@LIBRARIES
@pytest.mark.parametrize(("name", "build"), CASES)
def test_people_of_every_layout_in_camera_pixels(name: str, build, by_opencv: bool, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    detector = OnnxDetector(build(tmp_path / "model.onnx"), least_score=0.5, by_opencv=by_opencv)
    assert detector.layout.name == name
    # Twice as large as the input: its squares of 16 pixels are those of 32 here.
    image = picture(
        (2 * WIDTH, 2 * HEIGHT), ((32, 32, 48, 48), RED), ((64, 64, 128, 128), RED), ((0, 96, 32, 128), BLUE)
    )
    found = detector.detect(image)
    assert found.pixel[np.argsort(found.pixel[:, 3])[-1]].tolist() == pytest.approx([80, 64, 32, 64], abs=1e-3)
    assert [36, 32, 8, 16] in found.pixel.round(3).tolist()
    assert not ((found.pixel[:, 0] < 32) & (found.pixel[:, 1] >= 96)).any()
    assert (found.score > 0.85).any() and (found.score <= 1).all()
    # Its whole squares have whole scores: the layout's pixels are those that the model was made for.
    other = OnnxDetector(build(tmp_path / "model.onnx"), ["1"], 0.5, by_opencv).detect(image)
    assert [8, 96, 16, 32] in other.pixel.round(3).tolist()


@pytest.mark.parametrize("build", [build for name, build in CASES if "RT-DETR" not in name])
@pytest.mark.parametrize("size", [(64, 64), (192, 64), (61, 203)])
def test_boxes_of_letter_boxed_pictures(build, size: tuple[int, int], tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    detector = OnnxDetector(build(tmp_path / "model.onnx"), least_score=0.5)
    whole = detector.detect(picture(size, ((0, 0, *size), RED)))
    edges = np.concatenate([whole.pixel[:, :2], whole.pixel[:, :2] + whole.pixel[:, 2:]], axis=1)
    assert (edges >= 0).all() and (edges <= np.tile(size, 2)).all()
    margin = 16 / min(WIDTH / size[0], HEIGHT / size[1])  # a square that the border cuts is not red throughout
    assert edges[:, :2].min(axis=0) == pytest.approx([0, 0], abs=margin)
    assert edges[:, 2:].max(axis=0) == pytest.approx(size, abs=margin)


@pytest.mark.parametrize("fit", ["centre", "corner", "stretch"])
@pytest.mark.parametrize("size", [(64, 64), (200, 31), (640, 486)])
def test_a_picture_lies_where_its_place_says(fit, size: tuple[int, int]) -> None:  # type: ignore[no-untyped-def]
    whole, place = fit_picture(np.full((size[1], size[0], 3), 255, np.uint8), (96, 64), fit)
    rows, columns = np.flatnonzero((whole == 255).any(axis=(1, 2))), np.flatnonzero((whole == 255).any(axis=(0, 2)))
    edges = np.array([[columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]], float)
    assert whole.shape == (64, 96, 3)
    assert place.back(edges)[0].tolist() == pytest.approx([0, 0, *size])


def test_one_box_for_each_person_at_the_size_of_training(tmp_path: Path) -> None:
    detector = OnnxDetector(detector_models.yolo8(tmp_path / "model.onnx"), least_score=0.2)
    image = picture((WIDTH, HEIGHT), ((32, 0, 64, 32), RED))
    boxes = detector.detect(image).pixel
    inner = boxes[:, 3] < 32  # squares in a square of twice its side overlap by a quarter at most
    assert (~inner).sum() == 1 and inner.sum() == 4 + 16
    detector = OnnxDetector(_with_input(tmp_path / "model.onnx", -1, 3, "height", -1), least_score=0.9)
    found = detector.detect(picture((WIDTH, HEIGHT), ((64, 32, 96, 64), RED)))
    assert [72, 32, 16, 32] in found.pixel.tolist()


def test_classes_by_name_and_number(tmp_path: Path) -> None:
    image = picture((WIDTH, HEIGHT), ((0, 0, 32, 32), RED), ((64, 32, 96, 64), BLUE))
    names = {"names": "{0: 'Person', 1: 'dog'}"}
    model = detector_models.yolo8(tmp_path / "model.onnx", metadata=names)
    for classes, columns in (["person"], {8}), (["dog"], {72}), (["person", "dog"], {8, 72}), (["1"], {72}):
        found = OnnxDetector(model, classes, 0.9).detect(image).pixel
        assert {int(left) for left, _, width, _ in found.tolist() if width == 16} == columns
    for wrong, meant in ("dgo", "did you mean dog"), ("2", "expected one of person, dog"):
        refused(FormatError, rf"model\.onnx: classes: found '{wrong}', .*{meant}", OnnxDetector, model, [wrong])
    for text in "{", "{0: [", "7", "{'a': 'b'}":
        plain = detector_models.yolo8(tmp_path / "plain.onnx", metadata={"names": text})
        refused(FormatError, "expected one of person.*or its number", OnnxDetector, plain, ["dog"])


@LIBRARIES
@cases()
def test_features_are_those_of_each_crop(
    pictures: int | str, shape: list[int], subtracted: list[float], by_opencv: bool, tmp_path: Path
) -> None:
    images = [picture((90, 120), ((0, 0, 30, 120), RED), ((30, 0, 60, 60), BLUE)), picture((9, 9)), picture((50, 99))]
    boxes = ([[1, 2, 28, 100], [30, 10, 30, 50]], np.zeros((0, 4)), [[-9, -9, 90, 30], [99, 9, 2, 0]])
    colours = np.array([[1, 0, 0], [0, 0, 1], [100 / 255] * 3, [100 / 255] * 3])
    expected = (colours - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    for number in subtracted:
        expected = (colours * 255 if number > 1 else colours) - number
    model = detector_models.mean_colour(tmp_path / "model.onnx", pictures, shape, *subtracted)
    found = FeatureModel(model, by_opencv).describe(images, list(map(np.array, boxes)))
    assert found == pytest.approx(expected / np.linalg.norm(expected, axis=1, keepdims=True), abs=2e-3)


def test_refusals_name_the_file_and_the_outputs(tmp_path: Path) -> None:
    model = detector_models.unknown(tmp_path / "model.onnx")
    message = refused(FormatError, r"model\.onnx: found the outputs heat \[1, 3, 64, 96\]", OnnxDetector, model)
    assert all(layout.name in message for layout in LAYOUTS) and "\n" not in message
    refused(SourceError, r"none\.onnx: found No such file.*a model in ONNX", OnnxDetector, tmp_path / "none.onnx")
    detector = OnnxDetector(detector_models.yolo8(tmp_path / "later.onnx"))
    detector.layout = replace(detector.layout, decode=lambda *_: None)
    refused(FormatError, "expected those of", detector.detect, picture((WIDTH, HEIGHT)))
    for shape in [3], [3, 1, 1], [1, 1, 3]:
        match = rf"found the outputs features {re.escape(str(shape))}, expected one vector of each picture, \[1, length"
        refused(FormatError, match, FeatureModel, detector_models.mean_colour(tmp_path / "other.onnx", "n", shape))
    infinite = detector_models.mean_colour(tmp_path / "infinite.onnx", "n", (0, 3), np.inf)
    refused(FormatError, "infinite.onnx: found a feature that is no finite number", FeatureModel, infinite)
    (tmp_path / "text.onnx").write_text("this is no model\n")
    refused(FormatError, r"text\.onnx: found what is no ONNX", OnnxDetector, tmp_path / "text.onnx")
    for data, found in ((b"", "no graph"), (b"\x3a\0", "no inputs or no outputs"), (b"\x38\1", "in place of a")):
        refused(ValueError, found, parse_header, data)
    refused(FormatError, "an input of 9999x9999", OnnxDetector, _with_input(tmp_path / "large.onnx", 1, 3, 9999, 9999))
    refused(FormatError, "found the inputs", OnnxDetector, _with_input(tmp_path / "grey.onnx", 1, 1, HEIGHT, WIDTH))
    other = _with_input(tmp_path / "other.onnx", 1, 3, "height", "width", trained="[640, 640]")
    for by_opencv in (None, True):  # None: onnxruntime, where it is installed
        refused(FormatError, "does not run", OnnxDetector, other, by_opencv=by_opencv)
    assert list(MODELS) == [layout.name for layout in LAYOUTS]


def _with_input(path: Path, *shape: int | str, trained: str = "[64, 96]") -> Path:
    """A model as other programs may write it, with an input of another shape, names or -1 for free lengths."""
    model = onnx.load_model(detector_models.yolo8(path, metadata={"imgsz": trained}))
    model.graph.input[0].CopyFrom(onnx.helper.make_tensor_value_info("images", onnx.TensorProto.FLOAT, shape))
    onnx.save_model(model, path)
    return path


def test_any_bytes_are_a_header_or_a_value_error(tmp_path: Path) -> None:
    data = detector_models.yolo8(tmp_path / "model.onnx").read_bytes()
    header = parse_header(data)
    assert [str(one) for one in header.inputs] == ["images [1, 3, 64, 96]"]
    assert [str(one) for one in header.outputs] == ["output0 [1, 6, 126]"]
    random = np.random.default_rng(1)
    for _ in range(300):
        broken = bytearray(data[: random.integers(1, len(data))])
        broken[random.integers(len(broken))] = random.integers(256)
        try:
            parse_header(bytes(broken))
        except ValueError:
            continue


@LIBRARIES
def test_a_cut_model_is_refused_in_one_line(by_opencv: bool, tmp_path: Path) -> None:
    data = detector_models.yolo8(tmp_path / "model.onnx").read_bytes()
    for length in (10, len(data) // 2, len(data) - 5):
        (tmp_path / "cut.onnx").write_bytes(data[:length])
        assert "\n" not in refused(InputError, r"cut\.onnx", OnnxDetector, tmp_path / "cut.onnx", by_opencv=by_opencv)


def test_whole_people_are_found_with_margins_of_opencv_4() -> None:
    v, u = np.indices((136, 72))
    channels = (u * u + 3 * v) % 256, (v * v // 7 + u) % 256, ((u - 30) ** 2 + (v - 60) ** 2) // 9 % 256
    margins = window_margins(np.stack(channels, axis=-1).astype(np.uint8))
    of_opencv = tables(Path(__file__).with_suffix(".toml"))["margins_of_opencv_4"]
    assert margins.ravel().tolist() == pytest.approx(np.ravel(of_opencv).tolist(), abs=1e-4)
    video = cv2.VideoCapture(str(data_path("uu4_colour/cam1.avi")))
    for _ in range(21):
        _, picture = video.read()
    found = HogDetector(0.5).detect(np.asarray(picture, np.uint8))
    left, top, width, height = found.pixel[np.argsort(found.pixel[:, 0])].T
    assert (left + width / 2).tolist() == pytest.approx([375, 605], abs=12)
    assert top.tolist() == pytest.approx([97, 124], abs=12)
    assert (top + height).tolist() == pytest.approx([337, 353], abs=12)
    assert found.score.max() > 0.9


@pytest.mark.parametrize("size", [(63, 127), (64, 128), (300, 100)])
def test_an_empty_picture_shows_nobody(size: tuple[int, int]) -> None:
    assert len(HogDetector().detect(np.full((size[1], size[0], 3), 80, np.uint8))) == 0
