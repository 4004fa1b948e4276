"""The `data` commands: what can be fetched, fetching it, and checking a copy."""
