"""A second network that estimates light from points of a surface and their normals, trained without photos."""
