"""The machine beneath: files written as a whole, text as people save it, folders, compiled loops, committed data."""
