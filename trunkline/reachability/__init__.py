"""Where the rigid arm, the soft arm and both together can reach: kinematics, grids, meshes, maps."""
