"""Guided particle filter on joint states with colour models (Kim and Davis 2006; docs/how-it-works.md, Trackers)."""

from __future__ import annotations

from stseg.trackers.particles.tracker import ParticleTracker

__all__ = ["ParticleTracker"]
