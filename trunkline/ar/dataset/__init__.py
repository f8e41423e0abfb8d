"""What operators did in live sessions, for robots that learn from it."""
