"""Read and write the file formats of stereo benchmarks: images, PFM, KITTI's 16-bit PNG and ``calib.txt``."""
