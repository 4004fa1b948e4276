"""What a result is known by: its recipe, and the hashes of the code that makes it."""
