"""The product: a calibrated arm, what identification left open of it, and where both come from."""
