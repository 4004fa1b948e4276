"""One result on disk: drafted, published, read back, checked, and put in quarantine if it is damaged."""
