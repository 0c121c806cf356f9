"""The report in a real browser: no complaint, no request to anywhere, and the slider moves the pictures."""

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
import run_files
from browser import CHROMIUM, Page, chromium

from stseg.commands.report import report
from stseg.io.areas import read_lines, read_polygons

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (.ci/run installs it where it may)")

CANVASES = ("plan", "slice", "thread")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    report(run_files.write_small_run(folder / "small.h5"), output=folder / "small.html")
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Page]:
    with chromium(folder / "profile") as browser:
        browser.open(folder / "small.html")
        yield browser


def pictures(page: Page) -> list[str]:
    """Pictures of the canvases, once the slice of the frame has been drawn."""
    frame = page.ask("/frame (\\d+)/.exec(document.getElementById('clock').textContent)[1]")
    page.wait_for(f"document.getElementById('slice').dataset.frame === '{frame}'")
    return [page.ask(f"document.getElementById('{name}').toDataURL()") for name in CANVASES]


def slide(page: Page, index: int) -> None:
    """Move the slider as a hand would."""
    page.ask(f"slider.value = '{index}'; slider.dispatchEvent(new Event('input')); 0")


def test_it_loads_alone_and_address_menu_and_play_choose(page: Page) -> None:
    pictures(page)
    assert page.complaints == page.requests == []
    assert page.ask("document.images.length > 5 && [...document.images].every((image) => image.naturalWidth > 0)")
    assert page.picture(420, 900) and page.ask("document.documentElement.scrollWidth <= innerWidth"), "a telephone"
    page.ask("location.hash = 'frame=13'; 0")
    page.wait_for("document.getElementById('clock').textContent.includes('frame 13')")
    greatest = pictures(page)[1]
    page.ask("plane.value = '1'; plane.dispatchEvent(new Event('change')); 0")
    assert pictures(page)[1] != greatest
    page.ask("plane.value = 'greatest'; plane.dispatchEvent(new Event('change')); 0")
    assert pictures(page)[1] == greatest
    slide(page, 3)
    page.ask("play.click(); 0")
    page.wait_for("document.getElementById('clock').textContent.includes('frame 15')")
    page.wait_for("play.textContent === 'Play'")


def test_the_complaints_of_a_page_would_be_heard(folder: Path, tmp_path: Path) -> None:
    """The browser blocks what the page's policy forbids and tells of it, so that the test above can fail."""
    broken = (folder / "small.html").read_text("utf-8")
    broken = broken.replace("</main>", '<img src="http://example.org/a.png"><script>throw 1</script></main>')
    (tmp_path / "broken.html").write_text(broken, "utf-8")
    with chromium(tmp_path / "profile") as browser:
        browser.open(tmp_path / "broken.html")
        assert len(browser.complaints) >= 2


def test_the_slider_moves_pictures_and_lists_candidates(page: Page) -> None:
    slide(page, 0)
    early = pictures(page)
    assert page.ask("document.getElementById('clock').textContent").startswith("2.0 s, frame 10: 1 people, 1 ghosts")
    slide(page, 5)
    late = pictures(page)
    assert page.ask("document.getElementById('clock').textContent").startswith("3.0 s, frame 15: 2 people, 0 ghosts")
    assert all(before != after for before, after in zip(early, late, strict=True))
    slide(page, 0)
    assert pictures(page) == early
    slide(page, 0)
    rows = page.ask("[...document.getElementById('weighed').rows].map((row) => row.innerText)")
    assert len(rows) == 2
    assert any("ghost a" in row and "no -1.0" in row and "a view sees nobody there" in row for row in rows)


def test_a_drag_turns_the_tracks_and_one_path_is_shown(page: Page) -> None:
    before = pictures(page)
    page.ask("thread.onpointermove({ buttons: 1, movementX: 40, movementY: 10 }); 0")
    after = pictures(page)
    assert [old == new for old, new in zip(before, after, strict=True)] == [True, True, False]
    slide(page, 0)
    before = pictures(page)
    page.ask("whose.value = '1'; whose.onchange(); 0")
    assert pictures(page)[2] != before[2], "the other is paler in space and time"
    page.ask("whose.value = '-1'; whose.onchange(); 0")
    assert pictures(page) == before and page.complaints == []


def test_a_run_without_frames_has_a_page_that_does_not_complain(tmp_path: Path) -> None:
    report(run_files.write_empty_run(tmp_path / "empty.h5"), output=tmp_path / "empty.html")
    with chromium(tmp_path / "profile") as browser:
        browser.open(tmp_path / "empty.html")
        assert browser.complaints == [] and "No person was found" in browser.ask("document.body.innerText")


def test_zones_and_lines_are_drawn_on_the_plan_and_saved(page: Page, tmp_path: Path) -> None:
    """Corners are clicked at shares of the canvas; the file is what `stseg measure` reads."""
    click = """(u, v) => { const box = plan.getBoundingClientRect(); plan.dispatchEvent(new MouseEvent("click", {
        clientX: box.left + u * box.width, clientY: box.top + v * box.height })); }"""
    press = "document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }))"
    before = pictures(page)
    corners = "[[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]]"
    page.ask("document.getElementById('area-name').value = 'door <a>'; document.getElementById('draw-zone').click(); 0")
    page.ask(f"{corners}.forEach((place) => ({click})(...place)); {press}; 0")
    ends = "[[0.2, 0.5], [0.8, 0.5]]"
    page.ask(f"document.getElementById('draw-line').click(); {ends}.forEach((p) => ({click})(...p)); 0")
    page.ask(f"{press}; document.getElementById('draw-zone').click(); ({click})(0.5, 0.5); {press}; 0")
    assert [old == new for old, new in zip(before, pictures(page), strict=True)] == [False, True, True]
    href = page.ask("document.getElementById('save-areas').href")
    path = tmp_path / "areas.geojson"
    path.write_text(unquote(href.partition(",")[2]), "utf-8")
    (name, (ring,)), (line, (points,)) = *read_polygons(path), *read_lines(path)
    assert (name, line) == ("door <a>", "line 2")
    assert ring.shape == (4, 2) and points.shape == (2, 2)
    middle, ends = ring.mean(axis=0), points.mean(axis=0)
    np.testing.assert_allclose(middle, ends, atol=2e-3)
    np.testing.assert_allclose(middle, [0.3, 0.2], atol=2e-3)  # of the ground, and so of the canvas
    page.ask("document.getElementById('undo-area').click(); document.getElementById('undo-area').click(); 0")
    assert pictures(page) == before and page.complaints == []
