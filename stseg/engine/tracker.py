"""`stseg.Tracker`: tracks from arrays in memory, frame set by frame set, without a file."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from stseg.arrays import Boxes, Bytes, Observation, Rows
from stseg.config import Config
from stseg.engine.committed_frames import CommittedFrames
from stseg.engine.memory import require_memory
from stseg.engine.observations import PEOPLE, Views, as_observation, in_rig_order
from stseg.engine.pipeline import Pipeline
from stseg.engine.session import Session
from stseg.errors import SourceError
from stseg.foreground import IlluminationMonitor, make_background
from stseg.foreground.view_foreground import ViewForeground
from stseg.geometry import Rig
from stseg.geometry.rig import greatest_reduction
from stseg.io.recording.frames import FrameSet
from stseg.io.recording.pictures import reduced_view
from stseg.io.untrusted import limits
from stseg.records.tables import APPEARANCE, EVENT, TRAJECTORY, Tracks
from stseg.trajectories.final_tracks import CommittedRows


class Tracker:
    """Tracks people in observations that a program has in memory.

    An observation of a camera is a colour image uint8 (v, u, 3) in the order blue, green, red; a mask uint8 (v, u),
    0..255; a foreground likelihood float (v, u), 0..1; an instance image uint16 (v, u), 0 for background; boxes, float
    (n, 4) of left, top, width, height or (n, 5) with a score 0..1, `stseg.Boxes`, `supervision.Detections`, or a result
    of Ultralytics; or None where it is blind. Each camera keeps to one kind.

    Parameters
    ----------
    rig
        The cameras and the ground.
    config
        The constants of all stages; None for the defaults.
    tracker
        Its name: cut, frames, kalman, particles or belief.
    empty
        By the name of each camera that delivers colour images: images from which its background model is learned,
        uint8 (v, u, 3), of the empty scene or of one in which people move.
    classes
        Numbers of the classes to keep of detections that have classes; 0 is a person in the usual models.

    Raises
    ------
    InputError
        From every method, for an observation that does not suit its camera.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        config: Config | None = None,
        tracker: str = "cut",
        empty: Mapping[str, Iterable[Bytes]] | None = None,
        classes: Sequence[int] = PEOPLE,
    ) -> None:
        require_memory(rig, config or Config(), "rig")
        rig.require_coverage()
        self.rig, self.config, self._tracker = rig, config or Config(), tracker
        self._empty = {name: list(images) for name, images in (empty or {}).items()}
        self._classes = classes
        self._session: Session | None = None
        self._next, self._is_finished = 0, False
        self._first: int | None = None
        self._factors: list[int] = []
        self._kinds: list[str] = []

    def __repr__(self) -> str:
        return f"Tracker({self._tracker!r}, next frame {self._next}, {self.rig!r})"

    def add(self, views: Views | FrameSet, frame: int | None = None) -> list[CommittedFrames]:
        """The next frame set; the results that it decides, often none and then those of several frames.

        Parameters
        ----------
        views
            The observations, in the rig's order or by the names of the cameras; or a frame set with its number.
        frame
            Number of the frame; by default one more than the last, and 0 at first. All cameras are blind in frames that
            are left out.
        """
        if isinstance(views, FrameSet):
            return self.add(views.views, views.frame)
        frame = self._next if frame is None else frame
        place = f"frame {frame}"
        if self._is_finished:
            raise SourceError(place, "", "a frame set after finish()", "a new Tracker for another recording")
        if np.ndim(frame) or np.asarray(frame).dtype.kind not in "iu" or frame - self._next > limits.FRAMES:
            raise SourceError(place, "", f"the number {frame!r}", f"a whole number up to {limits.FRAMES}")
        if frame < self._next:
            raise SourceError(place, "", f"a frame before frame {self._next}", "frames in the order of time")
        observations = in_rig_order(self.rig, views, place, self._classes)
        if self._session is None:
            first = frame if self._first is None else self._first
            if all(view is None for view in observations):  # of what kind the cameras are is not known yet
                self._first, self._next = first, frame + 1
                return []
            self._session, self._next = self._begin(observations, first), first
        for camera, kind, view in zip(self.rig.cameras, self._kinds, observations, strict=True):
            if view is not None and _kind(view) != kind:
                raise SourceError(place, f"camera {camera.name}", _kind(view), f"{kind}, as in the frames before")
        results = []
        for number in range(self._next, frame):
            results += self._session.add(FrameSet(number, (None,) * len(observations)))
        self._next = frame + 1
        reduced = tuple(reduced_view(view, factor) for view, factor in zip(observations, self._factors, strict=True))
        return results + self._session.add(FrameSet(frame, reduced))

    def finish(self) -> list[CommittedFrames]:
        """No more frame sets; the results of all frames that are still open."""
        self._is_finished = True
        return [] if self._session is None else self._session.finish()

    def tracks(self, results: Sequence[CommittedFrames]) -> Tracks:
        """The tracks of a whole recording from all its results: ids decided anew, gaps filled, boxes in all views."""
        if self._session is None:
            return Tracks(np.zeros(0, TRAJECTORY))
        rows: Rows = np.concatenate([np.zeros(0, TRAJECTORY), *(result.commit.trajectory for result in results)])
        events: Rows = np.concatenate([np.zeros(0, EVENT), *(result.commit.events for result in results)])
        appearance: Rows = np.concatenate([np.zeros(0, APPEARANCE), *(result.appearance for result in results)])
        return self._session.pipeline.finished(CommittedRows(rows, events, appearance), self.rig)[0]

    def _begin(self, observations: Sequence[Observation], frame: int) -> Session:
        """The stages, for the kinds of the first observations; a blind camera is taken to be of the others' kind."""
        found = [None if view is None else _kind(view) for view in observations]
        common = next(kind for kind in found if kind is not None)
        self._kinds = [kind or common for kind in found]
        rows, grid = self.config.foreground.body_rows, self.rig.grid
        cameras = list(zip(self.rig.cameras, self._kinds, strict=True))
        self._factors = [greatest_reduction(camera, grid, rows) if kind == "images" else 1 for camera, kind in cameras]
        evidence = ["boxes" if kind in ("boxes", "instances") else "pixels" for kind in self._kinds]
        pipeline = Pipeline(self.rig.reduced(self._factors), evidence, self.config, self._tracker)
        return Session(pipeline, [self._foreground(k) for k in range(len(cameras))], frame)

    def _foreground(self, k: int) -> ViewForeground:
        if self._kinds[k] != "images":
            return ViewForeground()
        camera, rate, place = self.rig.cameras[k], self.rig.frame_rate, "background"
        images = [as_observation(image, camera, place) for image in self._empty.get(camera.name, ())]
        if not images:
            raise SourceError(place, f"camera {camera.name}", "no image", "some to learn it from: Tracker(..., empty=)")
        background = make_background(camera.reduced(self._factors[k]).size, rate, self.config.foreground)
        background.learn_from([np.asarray(reduced_view(image, self._factors[k]), np.uint8) for image in images])
        return ViewForeground(IlluminationMonitor(background, rate, self.config.illumination))


def _kind(view: Observation) -> str:
    """The kind of an observation, by its type."""
    if view is None or isinstance(view, Boxes):
        return "boxes"
    if view.ndim == 3:
        return "images"
    return {"f": "likelihoods", "u": "instances" if view.dtype == np.uint16 else "masks"}[view.dtype.kind]
