"""Circle and lemniscate with every controller."""
