"""Tracks of people on the ground from several fixed, overlapping cameras."""

__version__ = "0.1.0"
