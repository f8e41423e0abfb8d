"""What recorded poses say of a twin's tip at rest."""
