"""A simulated operator: two hands that tremble and miss a little, and what they do with what the eyes see."""
