"""What the matching network sees of an image: gray values, rank transform, companion transform."""
