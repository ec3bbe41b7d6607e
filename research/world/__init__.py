"""Path-traced test pairs under the priors of the real world, and how far training's lookups are from them."""
