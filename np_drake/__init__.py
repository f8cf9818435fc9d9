"""Models, estimation, diagnosis and control without a simulator: no Diagram, LeafSystem or MultibodyPlant."""

__version__ = "0.1.0"
