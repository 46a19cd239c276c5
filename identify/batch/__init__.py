"""Many logs: what to fit in a folder, one log's fit as a plain function of files, and that function over all cores."""
