"""Code that `decay` and `fit` share: the noise of a record, and estimates with 95 % intervals."""
