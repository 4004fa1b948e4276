"""The confidence of maps that another matcher made: what such a map looks like, and our costs of it."""
