"""Matching a user's own pairs."""
