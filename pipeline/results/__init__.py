"""What was made, read back."""
