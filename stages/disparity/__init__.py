"""Disparity maps: the winner of the costs, the right view, refinement, filling, depth."""
