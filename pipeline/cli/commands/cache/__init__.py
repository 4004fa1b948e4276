"""The commands of ``pipeline cache``."""
