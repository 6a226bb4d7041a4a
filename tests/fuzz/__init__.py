"""Random calls with hostile values: nothing crashes, hangs, or is silently wrong."""
