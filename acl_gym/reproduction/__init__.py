"""The thesis put to the test: its experiments, its claims, figures and a report."""
