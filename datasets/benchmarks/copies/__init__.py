"""Copies of benchmarks: what their publishers offer, fetched, and checked."""
