"""Which effects are reported as causes, and with which probability."""
