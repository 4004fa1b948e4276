"""Where there can be no confidence: the views or the costs do not tell one disparity from another."""
