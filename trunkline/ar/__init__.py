"""Point, preview, confirm, execute: teleoperation in augmented reality, and the robot that does it."""
