"""Physical effects that the nominal model leaves out: one pure object a file, for adding and for fitting alike."""
