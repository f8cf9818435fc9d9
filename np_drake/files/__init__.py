"""Files: read within limits, written whole or not at all, YAML with sources, locks on output
folders.
"""
