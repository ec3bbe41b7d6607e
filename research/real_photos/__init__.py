"""Models and baselines on a user's own photos with measured maps or light sources of known direction."""
