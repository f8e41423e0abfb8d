"""What goes wrong in a live session as its robot moves."""
