"""A run on a Dask cluster: where it is, what its workers prove, and how tasks survive them."""
