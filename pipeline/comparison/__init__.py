"""Compare with other matchers and confidence measures: the paper's experiments."""
