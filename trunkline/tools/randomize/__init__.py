"""Domain randomization: parameters drawn from what identification left open, or from the spread between arms."""
