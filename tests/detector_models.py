"""Small detectors in ONNX whose outputs are known: red squares of a picture are people, blue ones of another class.

Each stands for a layout. Its boxes are constant, one for each square of 8, 16 and 32 pixels of the input, half as wide
as the square and as tall; its scores are the mean red and the mean blue of the square, less that of the other.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

WIDTH, HEIGHT = 96, 64
"""Input, pixels."""
STRIDES = (8, 16, 32)


class Graph:
    """Nodes and constants of a model, added one by one; each method returns the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []

    def constant(self, array: object, kind: type = np.float32) -> str:
        name = f"constant{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(array, kind), name))
        return name

    def node(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or f"value{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def saved(
        self,
        path: Path,
        outputs: Mapping[str, tuple[int | str, ...]],
        metadata: dict[str, str] | None = None,
        more_inputs: tuple[onnx.ValueInfoProto, ...] = (),
        size: tuple[int | str, int | str] = (WIDTH, HEIGHT),
        pictures: int | str = 1,
    ) -> Path:
        """The model, with float outputs of these names and shapes."""
        picture = helper.make_tensor_value_info("images", TensorProto.FLOAT, [pictures, 3, *size[::-1]])
        results = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs.items()]
        graph = helper.make_graph(self.nodes, "detector", [picture, *more_inputs], results, self.constants)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        helper.set_model_props(model, metadata or {})
        path.write_bytes(model.SerializeToString())
        return path


def squares() -> tuple[np.ndarray, np.ndarray]:
    """Left and top (n, 2) and side (n, 1) of the squares, pixels, the smallest first, row by row."""
    corner = [np.indices((HEIGHT // s, WIDTH // s))[::-1].reshape(2, -1).T * s for s in STRIDES]
    side = [np.full((len(one), 1), stride) for one, stride in zip(corner, STRIDES, strict=True)]
    return np.concatenate(corner).astype(float), np.concatenate(side).astype(float)


CORNER, SIDE = squares()
COUNT = len(SIDE)
CENTRES = np.concatenate([CORNER + SIDE / 2, SIDE / 2, SIDE], axis=1)
"""Centre, width, height of the boxes."""
CORNERS = np.concatenate([CENTRES[:, :2] - CENTRES[:, 2:] / 2, CENTRES[:, :2] + CENTRES[:, 2:] / 2], axis=1)


def scores(graph: Graph, red: int, largest: float) -> str:
    """Scores [1, 2, COUNT]: how red and how blue the squares are, where channel `red` is red and white `largest`."""
    weights = np.zeros((2, 3, 1, 1))
    weights[0, red], weights[0, 2 - red], weights[1, red], weights[1, 2 - red] = 1, -1, -1, 1
    colours = graph.node("Conv", "images", graph.constant(weights / largest))
    shape = graph.constant([1, 2, -1], np.int64)
    parts = [
        graph.node("Reshape", graph.node("AveragePool", colours, kernel_shape=[s, s], strides=[s, s]), shape)
        for s in STRIDES
    ]
    return graph.node("Relu", graph.node("Concat", *parts, axis=2))


def rows(graph: Graph, columns: str, output: str = "") -> str:
    """[1, k, n] as [1, n, k]."""
    return graph.node("Transpose", columns, output=output, perm=[0, 2, 1])


def yolo8(path: Path, masks: int = 0, metadata: dict[str, str] | None = None) -> Path:
    graph = Graph()
    parts = [graph.constant(CENTRES.T[None]), scores(graph, 0, 1.0)]
    outputs: dict[str, tuple[int, ...]] = {"output0": (1, 6 + masks, COUNT)}
    if masks:
        parts.append(graph.constant(np.full((1, masks, COUNT), 9)))
        graph.node("Identity", graph.constant(np.ones((1, masks, 4, 6))), output="output1")
        outputs["output1"] = (1, masks, 4, 6)
    graph.node("Concat", *parts, output="output0", axis=1)
    return graph.saved(path, outputs, metadata)


def yolo5(path: Path) -> Path:
    """Of three predictions a square, the second is the box, and the others have no objectness."""
    graph = Graph()
    boxes = np.concatenate([np.tile(CENTRES, (3, 1)), np.repeat([[0], [0.9], [0]], COUNT, axis=0)], axis=1)
    classes = rows(graph, scores(graph, 0, 1.0))
    graph.node("Concat", graph.constant(boxes[None]), graph.node("Concat", *[classes] * 3, axis=1), output="o", axis=2)
    return graph.saved(path, {"o": (1, 3 * COUNT, 7)})


def one_prediction(path: Path, boxes: np.ndarray, objectness: float, red: int, largest: float) -> Path:
    graph = Graph()
    table = np.concatenate([boxes, np.full((COUNT, 1), objectness)], axis=1)
    graph.node("Concat", graph.constant(table[None]), rows(graph, scores(graph, red, largest)), output="o", axis=2)
    return graph.saved(path, {"o": (1, COUNT, 7)})


def yolox(path: Path) -> Path:
    """Offsets of half a square, and logarithms of sizes in sides."""
    raw = np.concatenate([np.full((COUNT, 2), 0.5), np.log(CENTRES[:, 2:] / SIDE)], axis=1)
    return one_prediction(path, raw, 0.9, 2, 255.0)


def _best(graph: Graph) -> tuple[str, str]:
    """Score and number of the better class of each square, each [1, COUNT]."""
    found = scores(graph, 0, 1.0)
    best = graph.node("ReduceMax", found, axes=[1], keepdims=0)
    number = graph.node("Cast", graph.node("ArgMax", found, axis=1, keepdims=0), to=TensorProto.FLOAT)
    return best, number


def _without_last(graph: Graph, table: str, output: str = "") -> str:
    """Rows [1, COUNT, k] without the last: as many as there are squares would be another layout."""
    ends = (graph.constant([one], np.int64) for one in (0, COUNT - 1, 1))
    return graph.node("Slice", table, *ends, output=output)


def suppressed(path: Path) -> Path:
    graph = Graph()
    columns = [graph.node("Reshape", one, graph.constant([1, COUNT, 1], np.int64)) for one in _best(graph)]
    _without_last(graph, graph.node("Concat", graph.constant(CORNERS[None]), *columns, axis=2), "o")
    return graph.saved(path, {"o": (1, COUNT - 1, 6)})


def suppressed_batch(path: Path) -> Path:
    """Number of the picture, corners, class, score."""
    graph = Graph()
    columns = [graph.node("Reshape", one, graph.constant([COUNT, 1], np.int64)) for one in _best(graph)]
    graph.node(
        "Concat", graph.constant(np.zeros((COUNT, 1))), graph.constant(CORNERS), *columns[::-1], output="o", axis=1
    )
    return graph.saved(path, {"o": (COUNT, 7)})


def lists(path: Path) -> Path:
    """As the authors of RT-DETR export it, for a size that is a second input."""
    graph = Graph()
    best, number = _best(graph)
    size = graph.node("Cast", "orig_target_sizes", to=TensorProto.FLOAT)
    corners = graph.constant((CORNERS / [WIDTH, HEIGHT, WIDTH, HEIGHT])[None])
    graph.node("Identity", number, output="labels")
    graph.node("Mul", corners, graph.node("Concat", size, size, axis=1), output="boxes")
    graph.node("Identity", best, output="scores")
    wanted = helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [1, 2])
    outputs = {"labels": (1, COUNT), "boxes": (1, COUNT, 4), "scores": (1, COUNT)}
    return graph.saved(path, outputs, more_inputs=(wanted,))


def rtdetr(path: Path) -> Path:
    graph = Graph()
    shares = CENTRES / [WIDTH, HEIGHT, WIDTH, HEIGHT]
    half = graph.node("Sub", rows(graph, scores(graph, 0, 1.0)), graph.constant(0.5))
    graph.node("Mul", half, graph.constant(8.0), output="logits")
    graph.node("Identity", graph.constant(shares[None]), output="pred_boxes")
    return graph.saved(path, {"logits": (1, COUNT, 2), "pred_boxes": (1, COUNT, 4)})


def rtdetr_single(path: Path) -> Path:
    """As Ultralytics exports it."""
    graph = Graph()
    parts = [
        graph.constant((CENTRES / [WIDTH, HEIGHT, WIDTH, HEIGHT])[None]),
        rows(graph, scores(graph, 0, 1.0)),
        graph.constant(np.zeros((1, COUNT, 1))),
    ]
    _without_last(graph, graph.node("Concat", *parts, axis=2), "o")
    return graph.saved(path, {"o": (1, COUNT - 1, 7)})


def unknown(path: Path) -> Path:
    graph = Graph()
    graph.node("Relu", "images", output="heat")
    return graph.saved(path, {"heat": (1, 3, HEIGHT, WIDTH)})


MODELS = {
    "YOLOv8 to YOLO11": (yolo8, partial(yolo8, masks=3)),
    "YOLOv5 or YOLOv7": (yolo5,),
    "YOLOv6": (partial(one_prediction, boxes=CENTRES, objectness=1.0, red=0, largest=1.0),),
    "YOLOX": (yolox, partial(one_prediction, boxes=CENTRES, objectness=0.9, red=2, largest=255.0)),
    "YOLO with suppression inside": (suppressed, suppressed_batch),
    "RT-DETR with its choice inside": (lists,),
    "RT-DETR": (rtdetr, rtdetr_single),
}
"""Models of each layout by its name."""


def people(path: Path, size: tuple[int, int], number: int = 1) -> Path:
    """A model with suppression inside that finds boxes around all red, all blue and all green pixels of a picture."""
    width, height = size
    graph, found = Graph(), []
    for weights in ((1, -1, 0), (0, -1, 1), (-1, 1, 0))[:number]:
        here = graph.node("Conv", "images", graph.constant(np.reshape(weights, (1, 3, 1, 1))))
        here = graph.node("Mul", graph.node("Sub", here, graph.constant(0.3)), graph.constant(1e4))
        flags = graph.node("Clip", here, graph.constant(0.0), graph.constant(1.0))
        edges = []
        for axis, length in ((3, width), (2, height)):
            line = graph.node("ReduceMax", flags, axes=[5 - axis], keepdims=0)
            steps = np.arange(length).reshape(1, 1, length)
            first, last = (
                graph.node("ReduceMax", graph.node("Mul", line, graph.constant(weight)), axes=[2], keepdims=1)
                for weight in (length - steps, steps + 1)
            )
            edges.append((graph.node("Sub", graph.constant(np.full((1, 1, 1), length)), first), last))
        score = graph.node("ReduceMax", flags, axes=[2, 3], keepdims=0)
        score = graph.node("Reshape", score, graph.constant([1, 1, 1], np.int64))
        (left, right), (top, bottom) = edges
        zero = graph.constant(np.zeros((1, 1, 1)))
        found.append(graph.node("Concat", left, top, right, bottom, score, zero, axis=2))
    graph.node("Concat", *found, output="o", axis=1)
    return graph.saved(path, {"o": (1, number, 6)}, size=size)


def mean_colour(path: Path, pictures: int | str = "n", shape: Sequence[int] = (0, 3), *subtracted: float) -> Path:
    """Features of a crop: the means of its colours, as the model gets them, less a number, in a shape (0: as given)."""
    graph, given = Graph(), "images"
    for number in subtracted:
        given = graph.node("Sub", given, graph.constant([[[number]]]))
    means = graph.node("GlobalAveragePool", given)
    graph.node("Reshape", means, graph.constant(shape, np.int64), output="features")
    return graph.saved(path, {"features": ("rows", "columns")}, size=("width", "height"), pictures=pictures)
