"""Each one thing that the harness studies: the study, its table and its figure in one place."""
