"""What will be made, and why."""
