"""Import of logs of other formats: map of columns, conventions, alignment of streams, and the sheet
beside each log.
"""
