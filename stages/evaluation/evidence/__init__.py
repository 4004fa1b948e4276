"""The confidence of a map by summed costs: what the map looks like and what the costs say, weighed by a small net."""
