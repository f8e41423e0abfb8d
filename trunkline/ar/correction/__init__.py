"""The last centimetre: commands that bring the tip as cameras see it to its target."""
