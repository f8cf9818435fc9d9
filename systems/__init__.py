"""LeafSystems and plant pieces; all memory lives in the Context."""
