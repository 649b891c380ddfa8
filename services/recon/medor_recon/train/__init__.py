"""Teaching the networks of reconstruction."""
