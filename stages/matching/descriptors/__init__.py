"""The descriptor-Net and the fast cost volume that it fills."""
