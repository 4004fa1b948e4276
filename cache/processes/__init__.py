"""How processes share a cache: locks on keys, and leases on what a run uses."""
