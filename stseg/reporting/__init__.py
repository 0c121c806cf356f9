"""Pictures of what a run found, and the page that holds them."""

from stseg.reporting.pictures.overlay import overlay
from stseg.reporting.pictures.plan import plan_view
from stseg.reporting.pictures.slices import marginal_picture, volume_picture
from stseg.reporting.pictures.spacetime import spacetime_picture

__all__ = ["marginal_picture", "overlay", "plan_view", "spacetime_picture", "volume_picture"]
