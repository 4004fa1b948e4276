"""What may be done with a filtered map at the end: the right view's opinion, sub-pixel places, holes filled."""
