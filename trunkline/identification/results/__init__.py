"""What an identification stage writes: tables, curves, scores."""
