"""How good a disparity map is, and how well a confidence tells its right pixels from its wrong ones."""
