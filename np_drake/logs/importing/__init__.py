"""Import of foreign logs: map of columns, conventions, alignment of streams, and the sheet that says what was done."""
