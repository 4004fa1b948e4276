"""Read what depth needs, the calibration of a rectified pair, from the files that people have."""
