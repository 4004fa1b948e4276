"""Semi-global aggregation of matching costs along paths, before the winner is taken."""
