"""What every other module may use, and which knows none of them."""
