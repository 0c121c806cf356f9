"""Scores of ground tracks against truth (docs/how-it-works.md, Evaluation).

`sequence` aligns truth and tracks frame by frame, excludes ignored rows and assigns people to tracks, and from the
matches come CLEAR and IDF1 (`clear`), and HOTA (`hota`). `scores` collects them.
"""

from stseg.evaluation.scores import Scores as Scores
from stseg.evaluation.scores import evaluate as evaluate
