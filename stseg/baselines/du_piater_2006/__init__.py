"""Belief propagation between particle filters in each view, a star graph for every target.

Du and Piater 2006; docs/how-it-works.md, Trackers.
"""

from stseg.baselines.du_piater_2006.tracker import BeliefTracker

__all__ = ["BeliefTracker"]
