"""Distance grids and meshes, which know no robot."""
