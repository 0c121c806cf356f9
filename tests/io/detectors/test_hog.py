"""The people detector by oriented gradients: margins of OpenCV 4, and people of a real recording."""

import cv2
import numpy as np
import pytest
from recordings import data_path

from stseg.io.detectors.hog import HogDetector, window_margins

OPENCV_4 = [
    [-3.3908, -3.2118, -3.6878, -3.6908, -3.4729, -3.5806],
    [-4.1516, -3.7093, -3.9087, -3.8200, -3.7309, -3.2153],
    [-3.8050, -3.3361, -3.5649, -3.2525, -3.6762, -3.8543],
    [-4.6520, -3.8127, -3.8982, -4.0287, -4.5966, -4.9619],
    [-4.0960, -3.6276, -4.2863, -4.2109, -4.7578, -5.3679],
    [-3.8104, -3.4192, -3.6644, -3.4096, -4.1090, -4.6598],
]
"""`HOGDescriptor.detect` of OpenCV 4.14 with winStride (8, 8) and padding (16, 16), of the picture below."""


def test_margins_are_those_of_opencv_4() -> None:
    v, u = np.indices((136, 72))
    channels = (u * u + 3 * v) % 256, (v * v // 7 + u) % 256, ((u - 30) ** 2 + (v - 60) ** 2) // 9 % 256
    margins = window_margins(np.stack(channels, axis=-1).astype(np.uint8))
    assert margins.ravel().tolist() == pytest.approx(np.ravel(OPENCV_4).tolist(), abs=1e-4)


@pytest.mark.parametrize("size", [(63, 127), (64, 128), (300, 100)])
def test_an_empty_picture_shows_nobody(size: tuple[int, int]) -> None:
    assert len(HogDetector().detect(np.full((size[1], size[0], 3), 80, np.uint8))) == 0


def test_people_who_stand_whole_are_found() -> None:
    video = cv2.VideoCapture(str(data_path("uu4_colour/cam1.avi")))
    for _ in range(21):
        _, picture = video.read()
    found = HogDetector(0.5).detect(np.asarray(picture, np.uint8))
    left, top, width, height = found.pixel[np.argsort(found.pixel[:, 0])].T
    assert (left + width / 2).tolist() == pytest.approx([375, 605], abs=12)
    assert top.tolist() == pytest.approx([97, 124], abs=12)
    assert (top + height).tolist() == pytest.approx([337, 353], abs=12)
    assert found.score.max() > 0.9
