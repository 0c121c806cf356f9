"""Guided particles: people followed by the colours of their clothes (KD06; METHODS 9)."""

from __future__ import annotations

from stseg.trackers.particles.tracker import ParticleTracker

__all__ = ["ParticleTracker"]
