"""Pictures of what a run found, and the page that holds them."""
