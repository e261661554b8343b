"""What a decay says, from a record or a scene to a folder of results."""
