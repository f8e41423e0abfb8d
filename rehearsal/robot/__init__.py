"""The stand-in for the physical robot: the lab's stranger on a Panda that moves, and objects that it can touch."""
