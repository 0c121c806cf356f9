"""Named scenes.

Their difficulty and seeds were fixed before anything was tuned on them: add a scene rather than change one.
"""

from dataclasses import replace

from stseg.simulation.crowd.routes import BORDER, CROSSING, Route, meeting
from stseg.simulation.scene import SceneSpec

_EASY = SceneSpec("easy", 5, (6.0, 6.0), 25.0, cameras=4, camera_distance=6.8, seed=501)
_DENSE = replace(
    _EASY,
    name="dense",
    people=14,
    cameras=8,
    camera_height=3.0,
    noise=3.5,
    light_drift=0.06,
    shadows=0.4,
    stay=18.0,
    seed=1402,
)
_DEMO = SceneSpec(
    "demo",
    4,
    (5.0, 5.0),
    8.0,
    cameras=4,
    camera_distance=5.8,
    size=(240, 180),
    noise=2.5,
    shadows=0.3,
    stay=8.0,
    seed=77,
)
_PLAZA = SceneSpec(
    "plaza",
    7,
    (20.0, 20.0),
    40.0,
    frame_rate=5.0,
    cameras=7,
    camera_distance=19.0,
    camera_height=3.6,
    field_of_view=66.0,
    size=(384, 288),
    distortion=(),
    stay=30.0,
    heights=(1.75, 1.75),
    cylinder=0.5,
    seed=1706,
)


def _scripted(name: str, seconds: float, routes: tuple[Route, ...], seed: int) -> SceneSpec:
    return replace(_DEMO, name=name, people=len(routes), seconds=seconds, stay=15.0, routes=routes, seed=seed)


_SCENES = (
    _EASY,
    _DENSE,
    replace(_DENSE, name="dense4", cameras=4),
    _DEMO,
    SceneSpec(
        "tiny", 2, (3.0, 3.0), 1.0, cameras=2, camera_distance=4.2, camera_height=2.4, size=(64, 48), noise=2.0, seed=4
    ),
    SceneSpec(
        "similar",
        4,
        (5.0, 5.0),
        100.0,
        cameras=3,
        camera_distance=5.8,
        size=(320, 240),
        light_drift=0.08,
        alike=3,
        stay=10000.0,
        seed=605,
    ),
    _PLAZA,
    replace(
        _PLAZA,
        name="large_plaza",
        people=10,
        area=(40.0, 40.0),
        seconds=60.0,
        frame_rate=7.0,
        cameras=8,
        camera_distance=38.0,
    ),
    replace(_EASY, name="school", people=6, heights=(1.0, 1.9), seed=818),
    replace(
        _EASY,
        name="animals",
        people=4,
        seconds=20.0,
        speed=(0.3, 1.2),
        heights=(0.5, 0.7),
        cylinder=0.35,
        length=1.1,
        seed=1160,
    ),
    SceneSpec(
        "long",
        10,
        (7.0, 7.0),
        1800.0,
        frame_rate=5.0,
        cameras=4,
        camera_distance=7.5,
        size=(240, 180),
        shadows=0.0,
        stay=1e6,
        kinds=("boxes",),
        seed=1810,
    ),
    replace(_DEMO, name="return", people=6, seconds=600.0, frame_rate=5.0, stay=25.0, absence=25.0, seed=1818),
    _scripted("crossing", 14.0, CROSSING, 91),
    _scripted("meeting", 16.0, meeting((1.72, 1.72)), 92),
    _scripted("meeting_heights", 16.0, meeting((1.68, 1.76)), 92),
    _scripted("border", 14.0, BORDER, 93),
)
NAMED: dict[str, SceneSpec] = {scene.name: scene for scene in _SCENES}
