"""The clicking page in a real browser: clicks give homographies, and the saved points give the cameras back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from browser import CHROMIUM, Page, chromium

from stseg.arrays import Floats
from stseg.calibration.points.point_fit import Points, fit_points
from stseg.commands.calibrate.app import app
from stseg.errors import ConfigError
from stseg.geometry import Camera
from stseg.io.calibrations.point_files import read_points
from stseg.simulation import SceneSpec
from stseg.simulation.rendering.cameras import build_rig

SPEC = SceneSpec("clicked", 1, (6.0, 6.0), 1.0, cameras=2, size=(480, 360), seed=3, distortion=())
CAMERAS = build_rig(SPEC).cameras
PLACES = np.array([[-2.0, -1.0], [2.0, -2.0], [1.5, 1.5], [-1.0, 2.0], [0.0, 0.0], [0.5, -1.5]])
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")


def make(folder: Path, *more: str, area: str = "-3,-3,3,3") -> Path:
    for camera in CAMERAS:
        cv2.imwrite(str(folder / f"{camera.name}.png"), np.full((360, 480, 3), 90, np.uint8))
    names = [str(folder / f"{camera.name}.png") for camera in CAMERAS]
    tokens = ["page", *names, f"-o={folder / 'points.html'}", f"--area={area}", *more]
    app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    return folder / "points.html"


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with chromium(tmp_path / "profile") as browser:
        browser.open(make(tmp_path))
        browser.wait_for("[...document.querySelectorAll('canvas')].length === 4")
        yield browser


def click(page: Page, canvas: str, share: Floats) -> None:
    """Click where a share of the canvas's width and height is."""
    u, v = share.tolist()
    page.ask(f"""(() => {{ const c = document.getElementById('{canvas}'), b = c.getBoundingClientRect();
      const at = {{ clientX: b.left + {u} * b.width, clientY: b.top + {v} * b.height, button: 0 }};
      c.dispatchEvent(new MouseEvent('mousedown', at)); dispatchEvent(new MouseEvent('mouseup', at));
      return 0; }})()""")


def press(page: Page, key: str, more: str = "") -> None:
    page.ask(f"dispatchEvent(new KeyboardEvent('keydown', {{ key: '{key}' {more} }})), 0")


def place(page: Page, ground: Floats, cameras: tuple[Camera, ...] = CAMERAS) -> None:
    click(page, "plan", np.array([(ground[0] + 3) / 6, (3 - ground[1]) / 6]))
    for camera in cameras:
        pixel = camera.project(ground[None], 0.0)[0][0]
        click(page, f"view-{camera.name}", (pixel + 0.5) / camera.size)


@needs_browser
def test_clicked_points_give_the_cameras(page: Page, tmp_path: Path) -> None:
    for ground in PLACES:
        press(page, "n")
        place(page, ground)
    assert page.complaints == [] and page.requests == []
    captions = page.ask("[...document.querySelectorAll('figcaption')].map((one) => one.textContent)")
    assert all("6 points, off by 0." in text for text in captions[1:]), captions
    rows = page.ask(
        "[...document.querySelectorAll('#residuals tr')].map((r) => [...r.children].map((c) => +c.textContent))"
    )
    assert len(rows) == 12 and max(row[2] for row in rows) < 0.6 and max(row[3] for row in rows) < 3
    points = tmp_path / "points.csv"
    points.write_text(
        page.ask("decodeURIComponent(document.getElementById('save').href.split(',').slice(1).join(','))")
    )
    for table, camera in zip(read_points(points), CAMERAS, strict=True):
        fit = fit_points(table.camera, camera.size, Points(table.pixel, table.place[:, :2], table.place[:, 2]))
        assert np.linalg.norm(fit.camera.centre - camera.centre) < 0.15
        projected = fit.camera.project(PLACES, 0.0)[0]
        assert np.abs(projected - camera.project(PLACES, 0.0)[0]).max() < 1.0


@needs_browser
def test_undo_poles_keys_and_the_hint(page: Page) -> None:
    for ground in PLACES[:5]:
        press(page, "n")
        place(page, ground)
    csv = page.ask("document.getElementById('csv').value")
    press(page, "ArrowRight", ", shiftKey: true")
    assert page.ask("document.getElementById('csv').value") != csv
    press(page, "z", ", ctrlKey: true")
    assert page.ask("document.getElementById('csv').value") == csv
    press(page, "p")
    click(page, "view-cam1", np.array([0.5, 0.3]))
    assert page.ask("document.getElementById('csv').value").count(",0.0025,-0.0025,2\n") == 1
    press(page, "Delete")
    assert page.ask("document.getElementById('csv').value") == csv
    yellow = """(() => { const c = document.getElementById('plan'), d = c.getContext('2d')
      .getImageData(0, 0, c.width, c.height).data; let n = 0;
      for (let k = 0; k < d.length; k += 4) n += d[k] > 220 && d[k + 1] > 140 && d[k + 1] < 190 && d[k + 2] < 40;
      return n; })()"""
    assert page.ask(yellow) > 30, "a ring where the next point helps most"


def test_wrong_options_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="x0 below x1"):
        make(tmp_path, area="3,0,-3,1")
    cv2.imwrite(str(tmp_path / "plan.png"), np.zeros((100, 200, 3), np.uint8))
    with pytest.raises(ConfigError, match="a picture that spans --area"):
        make(tmp_path, f"--plan={tmp_path / 'plan.png'}", "--overwrite")
