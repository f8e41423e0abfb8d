"""Motion capture, live: poses of named bodies in the cameras' frame, each stream in a process of its own."""
