"""The numbers to reach, each beside what it is compared with in the same run."""
