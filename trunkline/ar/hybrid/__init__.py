"""The Panda, the calibrated arm on its flange, a world and an object, in one model that can touch."""
