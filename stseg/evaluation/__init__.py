"""Scores of ground tracks against truth (docs/how-it-works.md, Evaluation).

`sequence` aligns truth and tracks frame by frame and excludes ignored rows, `matching` assigns people to tracks, and
from the matches come CLEAR (`clear`), IDF1 (`identity`) and HOTA (`hota`). `scores` collects them.
"""

from stseg.evaluation.scores import Scores, evaluate

__all__ = ["Scores", "evaluate"]
