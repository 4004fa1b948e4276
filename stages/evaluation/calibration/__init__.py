"""How often a confidence is right, measured on scenes that no network has seen."""
