"""Studies of swarms of moving agents, chapter 6: what is run, and how a run is made."""
