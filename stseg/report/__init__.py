"""Pictures of what a run found, and the page that holds them."""

from stseg.report.overlay import overlay
from stseg.report.plan import plan_view
from stseg.report.slices import marginal_picture, volume_picture
from stseg.report.spacetime import spacetime_picture

__all__ = ["marginal_picture", "overlay", "plan_view", "spacetime_picture", "volume_picture"]
