"""Valid files of detections to mutate: one small example of each format."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

BOXES = b"frame,left,top,width,height,score\n0,10.5,10,5,20,0.9\n3,11,10,5,20,1\n"
MOT = b"1,-1,10.5,10,5,20,0.9,-1,-1,-1\n3,-1,11,10,5,20,1,-1,-1,-1\n"
COCO = json.dumps([{"image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4], "score": 0.5}] * 2).encode()
COCO_DATA = json.dumps(
    {
        "images": [{"id": 1, "file_name": "a_0001.png", "width": 64, "height": 48}],
        "categories": [{"id": 1, "name": "person"}],
        "annotations": [
            {"image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4], "segmentation": [[1, 1, 5, 1, 5, 9]]},
            {"image_id": 1, "category_id": 1, "segmentation": {"size": [48, 64], "counts": [3, 10, 3059]}},
        ],
    }
).encode()
CVAT = b"""<annotations><meta><task><size>9</size></task></meta><track id="0" label="person">
<box frame="0" outside="0" xtl="1" ytl="2" xbr="9" ybr="20"/><polygon frame="1" outside="0" points="1,1;5,1;5,9"/>
</track></annotations>"""
CVAT_IMAGES = b"""<annotations>
<image id="0" name="a_0.png"><box label="person" xtl="1" ytl="2" xbr="9" ybr="20"/></image>
<image id="1" name="a_1.png"><polygon label="person" points="1,1;5,1;5,9"/></image></annotations>"""
YOLO = b"0 0.5 0.5 0.1 0.4 0.9\n0 0.25 0.5 0.1 0.4 0.8 7\n"
YOLO_OUTLINES = b"0 0.5 0.5 0.6 0.5 0.6 0.9 0.9\n0 0.1 0.1 0.2 0.1 0.2 0.2\n"
YOLO_NAMES = b"path: x\nnames:\n  0: person\n  1: 'car' # no\n"
YOLO_FRAME = [
    {
        "name": "person",
        "class": 0,
        "confidence": 0.9,
        "box": {"x1": 1, "y1": 2, "x2": 9, "y2": 20},
        "segments": {"x": [1, 5, 5], "y": [1, 1, 9]},
    }
]
YOLO_JSON = json.dumps([YOLO_FRAME, [], YOLO_FRAME]).encode()
YOLO_LINES = b"\n".join(json.dumps(frame).encode() for frame in (YOLO_FRAME, [], YOLO_FRAME))
MMDETECTION = json.dumps(
    {
        "labels": [0, 1],
        "scores": [0.9, 0.5],
        "bboxes": [[1, 2, 9, 20], [3, 4, 5, 6]],
        "masks": [{"size": [48, 64], "counts": "3:co2"}, None],
    }
).encode()
MMDETECTION_LIST = json.dumps(
    {"predictions": [{"labels": [0], "scores": [0.9], "bboxes": [[1, 2, 9, 20]]}] * 2, "visualization": []}
).encode()
WILDTRACK = json.dumps(
    [
        {
            "personID": 3,
            "positionID": 5,
            "views": [{"viewNum": 0, "xmin": 1, "ymin": 2, "xmax": 9, "ymax": 20}, {"viewNum": 1, "xmin": -1}],
        }
    ]
).encode()
_STUDIO_SHAPES = [
    {"type": "rectanglelabels", "value": {"x": 1, "y": 2, "width": 9, "height": 20, "rectanglelabels": ["person"]}},
    {"type": "polygonlabels", "value": {"points": [[1, 1], [5, 1], [5, 9]], "polygonlabels": ["person"]}},
]
LABEL_STUDIO = json.dumps(
    [{"data": {"image": f"/upload/{frame:04d}.png"}, "annotations": [{"result": _STUDIO_SHAPES}]} for frame in (0, 1)]
).encode()
_STUDIO_STEPS = [{"frame": frame, "enabled": True, "x": 1, "y": 2, "width": 9, "height": 20} for frame in (1, 9)]
_STUDIO_TRACK = {
    "type": "videorectangle",
    "value": {"framesCount": 20, "sequence": _STUDIO_STEPS, "labels": ["person"]},
}
LABEL_STUDIO_VIDEO = json.dumps([{"data": {"video": "a.mp4"}, "annotations": [{"result": [_STUDIO_TRACK]}]}]).encode()
_VIA_SHAPES = [
    {"name": "rect", "x": 1, "y": 2, "width": 9, "height": 20},
    {"name": "polygon", "all_points_x": [1, 5, 5], "all_points_y": [1, 1, 9]},
]
VIA = json.dumps(
    {
        "_via_img_metadata": {
            f"f{frame}.jpg1": {
                "filename": f"f{frame}.jpg",
                "regions": [{"shape_attributes": one, "region_attributes": {"kind": "person"}} for one in _VIA_SHAPES],
            }
            for frame in (0, 1)
        }
    }
).encode()
MAPPED = b"t,x1,y1,x2,y2,conf,label\n0,1,2,9,20,0.9,person\n3,1,2,9,20,0.8,car\n"
MOT_TRUTH = b"1,1,10.5,10,5,20,1,1,0.9\n3,1,11,10,5,20,0,7,0.5\n"


def parquet(folder: Path) -> bytes:
    """Boxes in Parquet."""
    arrow, tables = import_module("pyarrow"), import_module("pyarrow.parquet")
    columns = {
        "frame": [0, 3],
        "left": [1.0, 2.0],
        "top": [2, 3],
        "width": [9, 9],
        "height": [20, 21],
        "label": ["a", "b"],
    }
    tables.write_table(arrow.table(columns), folder / "boxes.parquet")
    return (folder / "boxes.parquet").read_bytes()
