"""From logs to filtered trials."""
