"""ACL against reinforcement learning: every method tuned alike, then compared (§7.3).

An `Arena` is a system as learners meet it; a `Contest` is a method with its settings in
an arena, and what is run. `tuning` searches for settings, `tuned` reads what was found.
"""
