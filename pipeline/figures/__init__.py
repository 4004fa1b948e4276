"""Draw every product with Matplotlib."""
