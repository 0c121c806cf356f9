"""Rigs made from points and from the recording itself, and rigs checked."""
