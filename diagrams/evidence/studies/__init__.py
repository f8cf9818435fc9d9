"""Studies: the tables and figures of the paper and of the docs, made anew."""
