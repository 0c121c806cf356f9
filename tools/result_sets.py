"""The sets that docs/development/results.md is measured on: what each is made from, and how it is scored.

Commands are written as one types them; $DATA is the folder of data sets, $WORK the folder for what is made.
"""

from dataclasses import dataclass

from stseg.simulation import NAMED

__all__ = ["SETS", "VARIANTS", "ResultSet", "Variant"]


@dataclass(frozen=True)
class Variant:
    """One variant of tracking: a tracker, and perhaps the constant by which it differs from that tracker's defaults."""

    name: str
    tracker: str
    setting: str = ""
    colour: bool = False
    """Whether it needs colour images."""

    @property
    def options(self) -> str:
        """Of `stseg run`."""
        return f"--tracker {self.tracker}" + (f" --set {self.setting}" if self.setting else "")


VARIANTS = {
    variant.name: variant
    for variant in (
        Variant("cut", "cut"),
        Variant("frames", "frames"),
        Variant("kalman", "kalman"),
        Variant("particles", "particles", colour=True),
        Variant("particles-search", "particles", "particles.method=search", True),
        Variant("particles-generic", "particles", "particles.method=generic", True),
        Variant("belief", "belief", colour=True),
        Variant("belief-condensation", "belief", "belief.method=condensation", True),
    )
}
"""In the order of the tables."""


@dataclass(frozen=True)
class ResultSet:
    """One set of the table.

    Attributes
    ----------
    name, views
    foreground, area, remark
        What the run starts from, what is scored, and what else there is to say: in words.
    frames
        A:B, half open: what is run and scored.
    rig, prepare, film
        The rig file, commands that make it, and the one that renders a simulated scene where `rig` is not there yet.
    truth, scoring
        CSV file, or None where there is none; options of `stseg evaluate` beside the frames.
    colour
        Whether it is followed in the variants, too, that need colour images.
    """

    name: str
    foreground: str
    views: int
    frames: str
    rig: str
    prepare: tuple[str, ...] = ()
    film: str | None = None
    truth: str | None = None
    scoring: str = ""
    area: str = "all the ground"
    remark: str = ""
    colour: bool = False

    @property
    def variants(self) -> tuple[Variant, ...]:
        """The variants that can follow here."""
        return tuple(variant for variant in VARIANTS.values() if self.colour or not variant.colour)

    def run_file(self, variant: Variant) -> str:
        """Where a run goes."""
        return f"$WORK/{self.name}_{variant.name}.h5"

    def run_command(self, variant: Variant) -> str:
        """The run that the row was measured on."""
        return f"stseg run {self.rig} -o {self.run_file(variant)} --frames {self.frames} {variant.options}"

    def score_command(self, variant: Variant) -> str:
        """The command that scores it."""
        options = f" {self.scoring}" if self.scoring else ""
        return f"stseg evaluate {self.run_file(variant)} {self.truth} --frames {self.frames}{options}"


_ROOM = "--size 644,486 --unit mm --up=-z --area=-2.5,-4.5,2.5,1.5"
_ROOM_1 = "--size 644,486 --unit mm --up=-z --area=-2.5,-3,2.5,2"
_CMC = "--names Cam1,Cam2,Cam3,Cam4 --size 1920,1024 --unit m --area=0,-0.4,7.67,3.6 --frame-rate 4"
_FASTER_RCNN, _FAIRMOT = "a detector's boxes, without scores", "another detector's boxes, with scores"
_FAIRMOT_BOXES = "'$DATA/cmc/fairmot/CMC2_{name}.csv'"
_FAIRMOT_FEATURES = f"{_FAIRMOT_BOXES} --score 0.3 --appearance '$DATA/cmc/fairmot/CMC2_{{name}}_appearance.npy'"
_CMC_AREA = "--area=1.9,-0.3,6.2,3.5"
_WILDTRACK_VIEWS = ("CVLab1", "CVLab2", "CVLab3", "CVLab4", "IDIAP1", "IDIAP2", "IDIAP3")
_WILDTRACK_FILES = " ".join(
    f"$DATA/wildtrack/calibrations/intrinsic_zero/intr_{view}.xml"
    f"+$DATA/wildtrack/calibrations/extrinsic/extr_{view}.xml"
    for view in _WILDTRACK_VIEWS
)
_WILDTRACK = (
    f"stseg calibrate import opencv {_WILDTRACK_FILES} -o $WORK/{{}}.toml --names {','.join(_WILDTRACK_VIEWS)} "
    "--size 1920,1080 --unit cm --area=-3,-9,9,27 --frame-rate 2 --cell 0.20 --source-kind boxes "
    "--source-pattern '{}/{{name}}.csv' --overwrite"
)


def _cmc(name: str, foreground: str, boxes: str, people: str) -> ResultSet:
    """One of the recordings of the room CMC; `boxes` are options that name a detector's files."""
    number = name[3]
    return ResultSet(
        name,
        foreground,
        4,
        "0:261",
        f"$WORK/{name}.toml",
        (
            f"stseg calibrate import matrix $DATA/cmc/cam?_cam_mat.mat -o $WORK/{name}.toml {_CMC} --source-kind boxes "
            f"--source-pattern {boxes} --overwrite",
            f"python tools/datasets.py cmc-truth $DATA/cmc/GT_CMC{number}_WORLD_CENTROID.txt $WORK/{name}.csv",
        ),
        truth=f"$WORK/{name}.csv",
        scoring=_CMC_AREA,
        area="x 1.9 .. 6.2, y -0.3 .. 3.5 m",
        remark=people,
    )


def _wildtrack(name: str, foreground: str, folder: str, *inputs: str) -> ResultSet:
    truth = "python tools/datasets.py wildtrack-truth $DATA/wildtrack/annotations_positions $WORK/wildtrack.csv"
    return ResultSet(
        name,
        foreground,
        7,
        "0:200",
        f"$WORK/{name}.toml",
        (*inputs, _WILDTRACK.format(name, folder), truth),
        truth="$WORK/wildtrack.csv",
        area="x -3 .. 9, y -9 .. 27 m",
        remark="24 people a frame",
    )


def _simulated(
    name: str, scene: str, rig: str, foreground: str, views: int, people: str, area: str = "6 m x 6 m"
) -> ResultSet:
    return ResultSet(
        name,
        foreground,
        views,
        f"0:{NAMED[scene].frames}",
        f"$WORK/{scene}/{rig}",
        film=f"stseg simulate $WORK/{scene} --scene {scene}",
        truth=f"$WORK/{scene}/truth.csv",
        area=area,
        remark=people,
    )


def _filmed(
    name: str, folder: str, options: str, frames: str, views: int, people: str, area: str = "6 m x 6 m"
) -> ResultSet:
    return ResultSet(
        name,
        "Gaussian mixtures on rendered video",
        views,
        frames,
        f"$WORK/{folder}/rig.toml",
        film=f"stseg simulate $WORK/{folder} {options}",
        truth=f"$WORK/{folder}/truth.csv",
        area=area,
        remark=people,
        colour=True,
    )


_ALL = (
    ResultSet(
        "laboratory",
        "a simulated detector's boxes of a real recording",
        4,
        "0:591",
        "$DATA/laboratory/rig.toml",
        truth="$DATA/laboratory/truth.csv",
        remark="6 people in a small room",
    ),
    ResultSet(
        "uu4",
        "given silhouettes (video of masks)",
        4,
        "0:136",
        "$WORK/uu4.toml",
        (
            f"stseg calibrate import opencv $DATA/uu4/cam?/config.xml -o $WORK/uu4.toml {_ROOM} --frame-rate 5 "
            "--source-pattern '$DATA/uu4/{name}/foreground_cropped.avi' --source-kind masks --overwrite",
        ),
        truth="$DATA/uu4/reference_tracks.csv",
        scoring="--ignore-flagged",
        remark="4 people, flagged rows not judged",
    ),
    ResultSet(
        "uu4_colour",
        "Gaussian mixtures on colour video, learned from the empty room",
        4,
        "0:136",
        "$WORK/uu4_colour.toml",
        (
            f"stseg calibrate import opencv $DATA/uu4/cam?/config.xml -o $WORK/uu4_colour.toml {_ROOM} --frame-rate 5 "
            "--source-pattern '$DATA/uu4_colour/{name}.avi' --background '$DATA/uu4/{name}/background.avi' --overwrite",
        ),
        truth="$DATA/uu4/reference_tracks.csv",
        scoring="--ignore-flagged",
        remark="4 people, flagged rows not judged",
        colour=True,
    ),
    _cmc("cmc1", _FASTER_RCNN, "'$DATA/cmc/DET_CMC1_{name}.txt' --first-frame 1", "3 people"),
    _cmc("cmc2", _FASTER_RCNN, "'$DATA/cmc/DET_CMC2_{name}.txt' --first-frame 1", "up to 10 people"),
    _cmc("cmc2_fairmot", _FAIRMOT, _FAIRMOT_BOXES, "up to 10 people"),
    _cmc("cmc2_fairmot_03", f"{_FAIRMOT} of 0.3 at least", f"{_FAIRMOT_BOXES} --score 0.3", "up to 10 people"),
    _cmc("cmc2_fairmot_features", f"{_FAIRMOT} of 0.3 at least, and features", _FAIRMOT_FEATURES, "up to 10 people"),
    _wildtrack("wildtrack", "detector-like boxes with scores", "$DATA/wildtrack/detector"),
    _wildtrack(
        "wildtrack_annotated",
        "annotated boxes: a check of geometry alone",
        "$WORK/wildtrack_annotated",
        "python tools/datasets.py wildtrack-boxes $DATA/wildtrack/annotations_positions $WORK/wildtrack_annotated",
    ),
    ResultSet(
        "pom",
        "given ragged masks, 160x120",
        2,
        "0:30",
        "$WORK/pom.toml",
        ("python tools/pom_rig.py $DATA/pom $WORK/pom.toml",),
        remark="no truth: counts alone",
    ),
    ResultSet(
        "uu1",
        "Gaussian mixtures on colour video, learned from the empty room",
        4,
        "0:426",
        "$WORK/uu1.toml",
        (
            f"stseg calibrate import opencv $DATA/uu1/cam?/config.xml -o $WORK/uu1.toml {_ROOM_1} --frame-rate 50 "
            "--source-pattern '$DATA/uu1/{name}/video.avi' --background '$DATA/uu1/{name}/background.avi' --overwrite",
        ),
        remark="1 person, no truth: counts alone",
        colour=True,
    ),
    _filmed("easy", "easy", "--scene easy", "0:250", 4, "5 people"),
    _simulated("dense", "dense", "rig.toml", "Gaussian mixtures on rendered video", 8, "14 people"),
    _simulated("dense_masks", "dense", "rig_masks.toml", "exact silhouettes of the rendered crowd", 8, "14 people"),
    _simulated("dense_boxes", "dense", "rig_boxes.toml", "a simulated detector's boxes", 8, "14 people"),
    _simulated("dense4", "dense4", "rig.toml", "Gaussian mixtures on rendered video", 4, "14 people"),
    _filmed("dense_50", "dense", "--scene dense", "0:50", 8, "14 people"),
    _filmed("similar", "similar", "--scene similar --seconds 30", "0:150", 3, "4 people, 3 dressed alike", "5 m x 5 m"),
    _filmed("two_cameras", "two_cameras", "--scene easy --cameras 2", "0:150", 2, "5 people"),
)

_MEETINGS = {
    "crossing": "7 people who cross at less than 0.5 m",
    "meeting": "2 people who stand together for 10 s and part",
    "meeting_heights": "the same, 8 cm apart in height",
    "border": "5 people who cross, meet, come and go where windows end",
}
_ENCOUNTERS = tuple(
    _simulated(f"{scene}{ending}", scene, rig, foreground, 4, people, "5 m x 5 m")
    for scene, people in _MEETINGS.items()
    for ending, rig, foreground in (
        ("", "rig.toml", "Gaussian mixtures on rendered video, 240x180"),
        ("_boxes", "rig_boxes.toml", "a simulated detector's boxes"),
    )
)

SETS = {one.name: one for one in (*_ALL, *_ENCOUNTERS)}
"""In the order of the table."""
