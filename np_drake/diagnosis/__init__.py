"""Where a simulator and reality part, which effect causes it, and how far the gap shrinks once it is added."""
