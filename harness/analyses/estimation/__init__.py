"""What `decay` and `fit` have in common: the noise of a record, and estimates with 95 % intervals."""
