"""Bodies of people: ellipsoids along the bones of a skeleton that walks.

The skeleton's proportions are those of Drillis and Contini, Body segment parameters, 1966 (as shares of the height),
rounded. In the body's own frame x points forward, y to the left and z up.
"""

from dataclasses import dataclass

import numpy as np

from stseg.arrays import Floats
from stseg.simulation.crowd.social_forces import CrowdFrame

_HIP, _THIGH, _SHIN, _ANKLE = 0.512, 0.245, 0.225, 0.042
_SHOULDER, _UPPER_ARM, _FOREARM = 0.80, 0.165, 0.20
_HIP_OFFSET, _SHOULDER_OFFSET = 0.05, 0.115
_LEG_SWING, _ARM_SWING = 0.42, 0.45  # radians to each side at full pace
_KNEE, _ELBOW = 0.85, 0.35  # radians of bend at full pace, in the leg that swings; at rest a tenth in the arm


@dataclass(frozen=True, slots=True)
class Part:
    """One ellipsoid."""

    name: str
    ends: tuple[str, str]
    """The two joints that it lies along."""
    sideways: float
    ahead: float
    """Half width and half depth, shares of the height."""
    stretch: float = 1.2
    """Half length over half the joints' distance: neighbours overlap, so that no gap shows."""


_SIDES = ("left", "right")
PARTS = (
    Part("head", ("chin", "crown"), 0.045, 0.055, 1.0),
    Part("neck", ("chest", "chin"), 0.032, 0.032, 1.6),
    Part("chest", ("navel", "chest"), 0.122, 0.07, 1.2),
    Part("hips", ("crotch", "waist"), 0.092, 0.066, 1.35),
    *(Part(f"{side} upper arm", (f"{side} shoulder", f"{side} elbow"), 0.03, 0.032, 1.3) for side in _SIDES),
    *(Part(f"{side} forearm", (f"{side} elbow", f"{side} hand"), 0.022, 0.024, 1.1) for side in _SIDES),
    *(Part(f"{side} thigh", (f"{side} hip", f"{side} knee"), 0.05, 0.056, 1.25) for side in _SIDES),
    *(Part(f"{side} shin", (f"{side} knee", f"{side} ankle"), 0.032, 0.036, 1.2) for side in _SIDES),
    *(Part(f"{side} foot", (f"{side} heel", f"{side} toe"), 0.026, 0.022, 1.0) for side in _SIDES),
)
"""The parts of a body, in the order of every array of parts."""


@dataclass(frozen=True, slots=True)
class Bodies:
    """Ellipsoids of all bodies: the points X with |form (X - centre)| <= 1."""

    centre: Floats
    """float64 (n, part, 3): metres."""
    form: Floats
    """float64 (n, part, 3, 3): rows point ahead, aside and along the part, divided by the half axes, 1/metre."""
    axes: Floats
    """float64 (n, part, 3, 3): rows are the half axes themselves, metres."""

    def corners(self, scale: float) -> Floats:
        """Corners of the boxes around the ellipsoids, scaled, float64 (n, part, 8, 3), metres."""
        signs = np.stack(np.meshgrid(*[(-scale, scale)] * 3, indexing="ij"), -1).reshape(8, 3)
        return np.asarray(self.centre[:, :, None] + signs @ self.axes)


def pose(crowd: CrowdFrame) -> Bodies:
    """The bodies of a crowd as it stands and walks; the lower foot of each is on the ground."""
    joints = _skeleton(crowd.phase, crowd.swing)
    ends = np.stack([[joints[name] for name in part.ends] for part in PARTS])  # part, end, n, 3
    low, high = np.moveaxis(ends, (0, 2), (2, 1))  # n, part, 3
    centre, axes = _ellipsoids(low, high, crowd.build)
    turn = _turn(crowd.heading)
    height = crowd.height[:, None, None]
    axes = height[..., None] * np.einsum("nij,npaj->npai", turn, axes)
    place = np.concatenate([crowd.ground, np.zeros((len(crowd.id), 1))], axis=1)
    centre = place[:, None] + height * np.einsum("nij,npj->npi", turn, centre)
    form = axes / (axes**2).sum(axis=-1, keepdims=True)
    return Bodies(centre, form, axes)


def upright_cylinders(crowd: CrowdFrame, width: float, length: float) -> Bodies:
    """The bodies of a crowd as upright cylinders, metres: ellipsoids in a stack, as many as a body has parts.

    Each reaches to the nearer end of the cylinder; they lie densely towards the ends, where they are flat. Between two
    of them the outline is within a tenth of its width.
    """
    share = (1 - np.cos(np.pi * (np.arange(len(PARTS)) + 0.5) / len(PARTS))) / 2
    n, height = len(crowd.id), crowd.height[:, None]
    centre, axes = np.zeros((n, len(PARTS), 3)), np.zeros((n, len(PARTS), 3, 3))
    centre[..., :2] = crowd.ground[:, None]
    centre[..., 2] = height * share
    axes[..., :2, :] = _turn(crowd.heading).transpose(0, 2, 1)[:, None, :2]
    axes[..., :2, :] *= np.array([[length / 2], [width / 2]])
    axes[..., 2, 2] = height * np.minimum(share, 1 - share)
    return Bodies(centre, axes / (axes**2).sum(axis=-1, keepdims=True), axes)


def _ellipsoids(low: Floats, high: Floats, build: Floats) -> tuple[Floats, Floats]:
    """Centres (n, part, 3) and half axes (n, part, 3, 3) of parts between joints, in shares of the height."""
    bone = high - low
    length = np.linalg.norm(bone, axis=-1, keepdims=True)
    along = bone / length
    left = np.array([0.0, 1.0, 0.0])
    sideways = left - (along @ left)[..., None] * along
    sideways /= np.linalg.norm(sideways, axis=-1, keepdims=True)
    ahead = np.cross(sideways, along)
    wide = build[:, None, None] * np.array([[part.sideways, part.ahead] for part in PARTS])
    half = length * 0.5 * np.array([part.stretch for part in PARTS])[:, None]
    return 0.5 * (low + high), np.stack([ahead * wide[..., 1:], sideways * wide[..., :1], along * half], axis=2)


def _skeleton(phase: Floats, swing: Floats) -> dict[str, Floats]:
    """Joints of bodies of height 1, float64 (n, 3) each."""
    nowhere = np.zeros(len(phase))

    def at(x: Floats | float, y: float, z: Floats | float) -> Floats:
        return np.stack(np.broadcast_arrays(x, y, z, nowhere)[:3], -1).astype(float)

    joints = {name: at(0.0, 0.0, z) for name, z in _TRUNK.items()}
    for side, sign in zip(_SIDES, (1, -1), strict=True):
        leg = sign * _LEG_SWING * swing * np.sin(phase)
        # The knee bends while the leg comes forward, when the angle at the hip grows.
        knee = _KNEE * swing * np.maximum(sign * np.cos(phase), 0.0) ** 2 + 0.05
        joints[f"{side} hip"] = at(0.0, sign * _HIP_OFFSET, _HIP)
        joints[f"{side} knee"] = joints[f"{side} hip"] + _THIGH * _down(leg)
        joints[f"{side} ankle"] = joints[f"{side} knee"] + _SHIN * _down(leg - knee)
        joints[f"{side} heel"] = joints[f"{side} ankle"] + at(-0.03, 0.0, -0.018)
        joints[f"{side} toe"] = joints[f"{side} ankle"] + at(0.11, 0.0, -0.02)
        arm = -sign * _ARM_SWING * swing * np.sin(phase)
        bend = _ELBOW * (0.1 + swing)
        joints[f"{side} shoulder"] = at(0.0, sign * _SHOULDER_OFFSET, _SHOULDER)
        joints[f"{side} elbow"] = joints[f"{side} shoulder"] + _UPPER_ARM * _down(arm) + at(0.0, sign * 0.012, 0.0)
        joints[f"{side} hand"] = joints[f"{side} elbow"] + _FOREARM * _down(arm + bend)
    lowest = np.minimum(joints["left ankle"][:, 2], joints["right ankle"][:, 2])
    drop = np.stack([nowhere, nowhere, lowest - _ANKLE], -1)
    return {name: joint - drop for name, joint in joints.items()}


_TRUNK = {"crotch": 0.46, "navel": 0.58, "waist": 0.62, "chest": 0.83, "chin": 0.865, "crown": 1.0}


def _down(angle: Floats) -> Floats:
    """Unit vectors that hang down, swung forward by an angle, float64 (n, 3)."""
    return np.stack([np.sin(angle), np.zeros_like(angle), -np.cos(angle)], -1)


def _turn(heading: Floats) -> Floats:
    """Rotations about the vertical, float64 (n, 3, 3)."""
    turn = np.zeros((len(heading), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(heading)
    turn[:, 1, 0], turn[:, 0, 1] = np.sin(heading), -np.sin(heading)
    turn[:, 2, 2] = 1.0
    return turn
