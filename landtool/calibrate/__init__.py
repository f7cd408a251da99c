"""Calibrates a camera from pictures of a board: finds its corners, chooses views, solves, says how sure it is."""
