"""Formats of flight logs: one file each; the list of them all is `library`."""
