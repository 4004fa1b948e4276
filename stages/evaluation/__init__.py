"""evaluation-Net: how much a pixel of a raw disparity map can be trusted, from the left view and the map alone."""
