"""matching-Net: how well two patches match, for a pair of patches or for a whole cost volume."""
