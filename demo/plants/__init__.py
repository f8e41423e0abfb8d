"""The arms that the lab can have on its bench, and what one does there."""
