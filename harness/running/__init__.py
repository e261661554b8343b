"""Built FMUs, ours or anybody's, run through fmpy; its only home."""
