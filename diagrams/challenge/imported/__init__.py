"""Campaigns on logs of other origin: rows left out, wrong conventions, and round trips through files."""
