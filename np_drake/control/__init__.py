"""Controllers cheap enough for hundreds of flights."""
