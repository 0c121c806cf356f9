"""Measures of a run: people in zones, crossings of lines, speeds, distances, density and flow."""

from stseg.measures.areas import Areas, Line, Zone
from stseg.measures.measure import Measures, measure_tracks

__all__ = ["Areas", "Line", "Measures", "Zone", "measure_tracks"]
