"""Valid files that fuzzing begins with."""

from __future__ import annotations

import json
import struct
from importlib import import_module
from io import BytesIO
from pathlib import Path

import cv2
import h5py
import numpy as np

from stseg.io.outputs.whole_files import replacing
from stseg.io.recording.pictures import encode_indexed

RIG = b"""format = 1
[scene]
name = "yard"
frame_rate = 10.0
x = [-2.0, 2.0]
y = [-2.0, 2.0]
polygon = [[-2.0, -2.0], [2.0, -2.0], [0.0, 2.0]]
doors = [[-0.4, -2.0, 0.4, -1.8], [0.0, 0.0, 0.0, 0.0]]
closed = true
[grid]
cell = 0.2
top = 1.8
planes = 4
[[camera]]
name = "cam1"
size = [64, 48]
ground = [[60.0, 32.0, 192.0], [0.0, 24.0, 324.0], [0.0, 1.0, 6.0]]
vertical = [0.0, -60.0, 0.0]
lens = { matrix = [[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]], distortion = [0.1, 0.0] }
offset = 0
on_missing = "blind"
source = { kind = "boxes", path = "boxes.csv", first_frame = 0, frames = 9 }
"""
CONFIG = b"[tracking]\npatience = 2.0\n[segments]\nlength = 60.0\n"
TRACKS = b"frame,id,x,y,flag\n0,1,0.5,-0.5,0\n1,1,0.6,-0.5,0\n1,b,1,1,1\n"
POINTS = b"camera,u,v,x,y,z\ncam1,1.5,2,3,4,0\ncam1,5,6,7,8,\ncam2,5,6,7,8,1.7\n"
EIGHT_POINTS = b"camera,u,v,x,y,z\n" + b"".join(
    b"a,%.1f,%.1f,%d,%d,%d\n" % (32 + 30 * x / (6 + y), 24 + 40 * (2 - z) / (6 + y), x, y, z)
    for x, y, z in np.ndindex(2, 2, 2)
)
_RING = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, -0.5]]
ZONES = json.dumps(
    {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "properties": {"name": "a"}, "geometry": {"type": "Polygon", "coordinates": [_RING]}},
            {"type": "Feature", "id": 7, "geometry": {"type": "MultiPolygon", "coordinates": [[_RING], [_RING]]}},
        ],
    }
).encode()
LINES = json.dumps(
    {"type": "Feature", "properties": {"name": "a"}, "geometry": {"type": "LineString", "coordinates": _RING}}
).encode()
ANSWERS = b"action,frame,id,other,name\nswap,12,1,2,\nname,,1,,Ann\nsplit,13,2,,\ndelete,,2,,\nkeep,,1,2,\n"
NAMES = b"id,name\n1,Ann\n2,Bob\n"
NUMBERS = " ".join(map(str, np.arange(12.0))).encode()
OPENCV = b"""<?xml version="1.0"?><opencv_storage>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>500. 0. 320. 0. 510. 240. 0. 0. 1.
</data></camera_matrix><distortion_coefficients><data>0.1 0. 0. 0.</data></distortion_coefficients>
<rvec><data>1.5 0.1 0.2</data></rvec><tvec><data>1. 2. 3.</data></tvec></opencv_storage>"""
TSAI = b"""<Camera name="View_001"><Geometry width="768" height="576" dpx="0.0048" dpy="0.0046"/>
<Intrinsic focal="5.5" kappa1="0.0051" cx="324.2" cy="282.6" sx="1"/>
<Extrinsic tx="-4.8" ty="5570" tz="36000" rx="1.6" ry="0.9" rz="-0.5"/></Camera>"""
KRT = json.dumps({"c1": {"K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "RT": np.eye(3, 4).tolist(), "imgSize": [64, 48]}})
POSES = b"""[cam_0]
name = "a"
size = [64, 48]
matrix = [[500.0, 0.0, 32.0], [0.0, 500.0, 24.0], [0.0, 0.0, 1.0]]
distortions = [0.1, 0.0, 0.0, 0.0, 0.0]
rotation = [1.5, 0.1, 0.2]
translation = [1.0, 2.0, 3.0]
[metadata]
"""
NVIDIA = json.dumps({"sensors": [{"id": "c", "cameraMatrix": np.eye(3, 4).tolist(), "attributes": [
    {"name": "frameWidth", "value": "64"}, {"name": "frameHeight", "value": "48"}]}]}).encode()  # fmt: skip
KALIBR = b"""cam0:
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [0.1, 0.0, 0.0, 0.0]
  intrinsics: [500.0, 500.0, 32.0, 24.0]
  resolution: [64, 48]
"""
POM = b"1.0 0.1 5.0\n0.0 1.2 3.0\n0.0 0.01 1.0\n1.0 0.1 4.0\n0.0 1.1 2.0\n0.0 0.01 1.0\n"
BEGUN = json.dumps({"config": {"a": 1}, "rig": {"b": "c"}}).encode()
NOTES = json.dumps({"cam1": [["a.avi", 9], ["b.avi", 3]]}).encode()
LIVE_CORRECTIONS = b"decision_frame,first,last,id,corrected_id\n50,20,50,1,2\n50,20,50,2,1\n"
LIVE_TABLE = b"frame,time,id,x,y,height,score\n0,0.000,1,0.500,0.500,1.700,3.000\n"


def mat() -> bytes:
    """A MATLAB file of version 5 with a 3x4 matrix."""
    values = np.arange(12, dtype="<f8").tobytes()
    body = (
        struct.pack("<IIII", 6, 8, 6, 0)
        + struct.pack("<IIii", 5, 8, 3, 4)
        + struct.pack("<HH4s", 1, 1, b"P\0\0\0")
        + struct.pack("<II", 9, len(values))
        + values
    )
    return b"MATLAB".ljust(124) + b"\0\1IM" + struct.pack("<II", 14, len(body)) + body


def npy() -> bytes:
    file = BytesIO()
    np.save(file, np.arange(12.0).reshape(3, 4))
    return file.getvalue()


def npz() -> bytes:
    file = BytesIO()
    matrix = np.arange(12.0).reshape(3, 4)
    np.savez_compressed(file, files=np.array([1], np.int64), times0_0=np.arange(9.0), P=matrix)
    return file.getvalue()


def floor_plan(suffix: str) -> bytes:
    """A picture of the ground in colour."""
    return bytes(cv2.imencode(suffix, np.full((48, 64, 3), 90, np.uint8))[1])


def matlab_hdf5(folder: Path) -> bytes:
    with replacing(folder / "p.mat", overwrite=True) as part, h5py.File(part, "w") as file:
        file["P"] = np.arange(12.0).reshape(4, 3)
    return (folder / "p.mat").read_bytes()


def png(indexed: bool) -> bytes:
    numbers = np.arange(64 * 48, dtype=np.uint8).reshape(48, 64) % 7
    if indexed:
        return encode_indexed(numbers, np.zeros((256, 3), np.uint8))
    return bytes(cv2.imencode(".png", numbers.astype(np.uint16))[1])


def picture(suffix: str) -> bytes:
    """A picture in colour."""
    ramp = np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3) % 251
    return bytes(cv2.imencode(suffix, ramp.astype(np.uint8))[1])


def video(folder: Path, suffix: str, codec: str) -> bytes:
    path = folder / f"film{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 10, (64, 48))
    for frame in range(4):
        writer.write(np.full((48, 64, 3), 20 * frame, np.uint8))
    writer.release()
    return path.read_bytes()


# Detections


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
