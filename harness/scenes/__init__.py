"""What people write: scenes, and what they couple."""
