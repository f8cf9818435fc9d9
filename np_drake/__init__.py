"""The science of np_drake: no Diagram, no LeafSystem, no MultibodyPlant."""

__version__ = "0.1.0"
