"""A user's own pairs of images: from files, from arrays, from folders of many."""
