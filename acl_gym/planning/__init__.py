"""Dynamic programming with a known model: the optimum to compare the learners with."""
