"""The answers to compare with: closed forms, series, other people's solvers, stored references."""
