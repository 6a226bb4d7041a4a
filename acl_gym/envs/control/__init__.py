"""What all systems of this package share, whatever their dynamics."""
