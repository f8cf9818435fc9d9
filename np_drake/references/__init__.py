"""Reference motions as flat outputs with four analytic derivatives, and the feed-forward they
imply.
"""
