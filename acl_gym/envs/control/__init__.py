"""What all control systems of this package share."""
