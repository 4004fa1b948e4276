"""What the paper says: pure functions over arrays, the two networks, their training, the metrics."""
