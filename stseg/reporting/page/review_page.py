"""The page that asks about doubtful identities: a plan of the seconds around each decision, one key for each answer."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from shlex import quote

import cv2
import numpy as np

from stseg.arrays import AnyArray, Bytes, Observation, Rows, ground_of
from stseg.geometry import Camera, Grid, Rig
from stseg.reporting.charts import clock_time
from stseg.reporting.figures import backdrop
from stseg.reporting.page.html import jpeg_uri, page, script_json
from stseg.reporting.pictures.colours import hex_colour, track_colour
from stseg.reporting.pictures.overlay import overlay

_WIDTH, _HEIGHT = 960, 260
_FILM_FRAMES = 80
"""Moments of the plan's film, at most."""
_OTHERS = "#b5bac2"
"""Colour of tracks that are not asked about."""
_VIEWS = 2
"""Views of each decision."""


@dataclass(frozen=True)
class Question:
    """A question with its answers."""

    text: str
    """The question, one line."""
    choices: Sequence[tuple[str, str, str]]
    """Key, words and line of the answers file of each answer."""
    pictures: Sequence[tuple[str, Bytes]]
    """Caption and picture of each moment and view."""
    film: dict[str, object]
    """The tracks of the seconds around, see `plan_film`."""


def review_page(title: str, run_name: str, grid: Grid, questions: Sequence[Question], shows_images: bool) -> str:
    """The page's text; `run_name` is the run file's."""
    items = "\n".join(map(_item, questions)) if shows_images else ""
    privacy = "This page shows images from the cameras: share it with care." if shows_images else "No camera image."
    corrected = f"{run_name.removesuffix('.h5')}.corrected.h5"
    command = f"stseg correct {quote(run_name)} answers.csv -o {quote(corrected)}"
    border = None if grid.polygon is None else np.asarray(grid.polygon).tolist()
    question_data = [{"text": one.text, "choices": one.choices, "film": one.film} for one in questions]
    data = script_json({"x": grid.x, "y": grid.y, "polygon": border, "questions": question_data})
    body = _BODY.format(title=escape(title), items=items, privacy=privacy, command=escape(command))
    return page(title, body, data, ("review_page.js",), _STYLE)


def _item(question: Question) -> str:
    pictures = "".join(
        f'<figure><img alt="{words}" src="{jpeg_uri(picture, 80)}"><figcaption>{words}</figcaption></figure>'
        for words, picture in ((escape(caption), picture) for caption, picture in question.pictures)
    )
    return f'<div class="item row" hidden>{pictures}</div>'


def plan_film(
    trajectory: Rows, first: int, last: int, start: int, frame_rate: float, ids: Sequence[int]
) -> dict[str, object]:
    """Times and places of all tracks from one frame to another, for the script; those of `ids` in their colours.

    The slider begins at the frame `start`.
    """
    frames = np.unique(np.linspace(first, last, min(last - first + 1, _FILM_FRAMES)).astype(int))
    rows = trajectory[np.isin(trajectory["frame"], frames)]
    tracks = []
    for identity in np.unique(rows["id"]).tolist():
        path = rows[rows["id"] == identity]
        moment, place = np.searchsorted(frames, path["frame"]), np.round(ground_of(path), 2)
        colour = hex_colour(track_colour(identity)) if identity in ids else _OTHERS
        tracks.append({"id": identity, "colour": colour, "moment": moment.tolist(), "place": place.tolist()})
    clock = [clock_time(frame / frame_rate) for frame in frames.tolist()]
    return {"clock": clock, "tracks": tracks, "start": int(np.searchsorted(frames, start))}


def best_views(rig: Rig, ground: AnyArray) -> list[int]:
    """The views that show ground points (n, 2) at body height, ordered by the distance between them in the image."""
    scores = []
    for view, camera in enumerate(rig.cameras):
        pixel, ahead = camera.project(np.asarray(ground, float), 0.9)
        visible = float((ahead & camera.inside(pixel)).mean())
        separation = float(np.ptp(pixel[:, 0])) / camera.size[0] if ahead.all() else 0.0
        distance = float(np.hypot(*(np.asarray(ground, float).mean(axis=0) - camera.centre[:2])))
        scores.append((-visible, -separation if len(pixel) > 1 and separation > 0 else distance, view))
    return [view for *_, view in sorted(scores)][:_VIEWS]


def moment_picture(
    rig: Rig, view: int, trajectory: Rows, frame: int, ids: Sequence[int], observation: Observation, trail: int
) -> Bytes:
    """A crop of one view around some tracks in a frame, with pillars and trails."""
    camera = rig.cameras[view]
    picture = overlay(camera, rig.grid, backdrop(observation, camera.size), trajectory, frame, trail, _WIDTH)
    nearest = trajectory[np.isin(trajectory["id"], ids)]
    nearest = nearest[np.abs(nearest["frame"] - frame) <= trail]
    part = _crop(picture, camera, nearest) if len(nearest) else picture
    scale = _HEIGHT / part.shape[0]
    return np.asarray(cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)


def _crop(picture: Bytes, camera: Camera, rows: Rows) -> Bytes:
    ground = ground_of(rows)
    pixel = np.concatenate([camera.project(ground, 0.0)[0], camera.project(ground, 1.9)[0]])
    pixel = pixel[np.isfinite(pixel).all(axis=1)] * picture.shape[1] / camera.size[0]
    if not len(pixel):
        return picture
    limit = np.array([picture.shape[1], picture.shape[0]])
    low, high = np.clip(pixel.min(axis=0) - 60, 0, limit - 80), np.clip(pixel.max(axis=0) + 60, 80, limit)
    (left, top), (right, bottom) = low.astype(int).tolist(), high.astype(int).tolist()
    return picture[top:bottom, left:right] if right - left > 40 and bottom - top > 40 else picture


_STYLE = """
main { max-width: none } .row { display: flex; flex-wrap: wrap; gap: 10px; margin: 10px 0 }
.row[hidden] { display: none } .row figure { margin: 0 }
.both { display: flex; flex-wrap: wrap; gap: 20px } .both > div { flex: 1 1 min(420px, 100%); min-width: 0 }
.row img { max-width: 100% }
.both > div:empty, [hidden] { display: none !important }
#slider { flex: 1 } #plan { border: 1px solid var(--rule); max-width: 100% }
#time { display: flex; position: static; background: none; box-shadow: none; border: 0 }
#time { padding: 6px 0 }
#choices button { margin-right: 12px } #choices .chosen { outline: 3px solid var(--accent) }
#csv { width: 100%; height: 120px; font-family: monospace }
"""

_BODY = """<main>
<h1>{title}</h1>
<p>The most doubtful decision first; what is more than 99 % certain is not asked.
A key answers and goes on; arrows move, Backspace takes an answer back.
The slider and the space bar play the plan of these seconds; what you cannot tell stays as it is. {privacy}</p>
<h2 id="question"></h2>
<p><b id="count"></b> <span id="choices"></span></p>
<div class="both"><div><canvas id="plan"></canvas>
<p id="time"><input id="slider" type="range" min="0" value="0" aria-label="time"> <span id="clock"></span></p></div>
<div>{items}</div></div>
<p><a id="save" download="answers.csv">Save answers.csv</a></p>
<textarea id="csv" readonly aria-label="answers.csv"></textarea>
<p>Then: <code>{command}</code></p>
</main>"""
