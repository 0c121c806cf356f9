"""Guided particle filter on joint states with colour models (Kim and Davis 2006; docs/how-it-works.md, Trackers)."""

from __future__ import annotations

from stseg.baselines.kim_davis_2006.tracker import ParticleTracker

__all__ = ["ParticleTracker"]
