"""How loops and networks run on this CPU: compiled loops, number formats, threads, memory."""
