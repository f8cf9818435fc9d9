"""From flight logs to residuals on a uniform grid."""
