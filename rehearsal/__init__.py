"""The paper's experiments rehearsed, on a stand-in for the physical robot that is not the twin."""
