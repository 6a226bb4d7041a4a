"""The experiments: runs, their statistics, figures and reports."""
