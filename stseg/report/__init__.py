"""Pictures of what a run found, and the page that holds them."""

from stseg.report.pictures.overlay import overlay
from stseg.report.pictures.plan import plan_view
from stseg.report.pictures.slices import marginal_picture, volume_picture
from stseg.report.pictures.spacetime import spacetime_picture

__all__ = ["marginal_picture", "overlay", "plan_view", "spacetime_picture", "volume_picture"]
