"""Belief propagation between particle filters in each view, a star graph for every target (DP06; METHODS 9)."""

from stseg.trackers.belief.tracker import BeliefTracker

__all__ = ["BeliefTracker"]
