"""Many runs over parameters."""
