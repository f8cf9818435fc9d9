"""Examination of flight logs before a diagnosis: usable or not, and which effects they can tell, to
what size.
"""
