"""Other matchers and confidence measures beside ours: the paper's experiments."""
