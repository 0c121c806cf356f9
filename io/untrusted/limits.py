"""Limits of everything that comes from outside, stated once. Beyond them a file is refused in one line.

They bound memory and time, and lie far beyond real recordings: a rig of 256 cameras, a week at 30 frames per second.
docs/security.md lists them for users.
"""

CAMERAS = 256
NAME = 100
"""Characters of a camera's or scene's name."""
PATH = 4096
"""Bytes of a path, and 255 of each part of it: what file systems take."""
PATH_PART = 255

SIDE = 32_768
"""Pixels along one side of an image."""
PIXELS = 64_000_000
"""Pixels of an image."""

CELLS = 20_000_000
"""Cells of one frame's volume; a few hundred bytes of memory each hold while a window is tracked."""
GROUND_CELLS = 4_000_000
"""Cells of one plane."""
AXIS_CELLS = 20_000
"""Cells along one side of the ground rectangle."""
PLANES = 1_000
CORNERS = 10_000
"""Corners of the polygon."""

AREAS = 1_000
"""Zones, and lines, of one measurement; CORNERS is the limit of each one's points."""

METRES = 1e8
"""Coordinates on the ground, metres: those of map projections fit."""
CELL = (1e-3, 1e3)
"""Side of a cell, metres."""
TOP = (1e-3, 1e3)
"""Height of the uppermost plane, metres."""
BODY = (1e-3, 2.2)
"""Sizes of bodies, metres: taller pillars reach above most grids."""
FRAME_RATE = (1e-3, 1e5)
"""Frames per second."""
NUMBER = 1e12
"""Any other number of a calibration or rig, by its size."""

FRAMES = 20_000_000
"""Frames of a recording, and frame numbers."""
BOXES_PER_FRAME = 10_000
"""Detections of one camera in one frame."""
FEATURES = 4096
"""Numbers of a detector's appearance feature."""
FEATURES_FILE = 1 << 28
"""Bytes of the appearance features of one camera's boxes, without the header of their file."""
PEOPLE_PER_FRAME = 2_000
"""Rows of one frame in a table of tracks."""
ROWS = 20_000_000
"""Rows of a table."""
INTERPOLATED = 500_000
"""Boxes between the keyframes of a file."""
POINTS = 20_000
"""Point correspondences of a scene."""
LINE = 1 << 16
"""Characters of a line of text."""

TEXT_FILE = 1 << 24
"""Bytes of a rig, a configuration or a calibration."""
DETECTIONS_FILE = 1 << 29
"""Bytes of a file of detections that is read whole."""
MODEL_FILE = (1 << 31) - 1
"""Bytes of a detector's model: ONNX has no more in one file."""
UNPACKED = 1 << 26
"""Bytes of an unpacked member of an archive, and of a whole small archive."""
MEMBERS = 10_000
"""Members of an archive, datasets of an HDF5 file."""
DOTTED_KEY = 32
"""Parts of a dotted key of TOML: tomllib needs a time that grows with the square of their number."""
