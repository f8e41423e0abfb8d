"""The arm: geometry and material in, MuJoCo model out."""
