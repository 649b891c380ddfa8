"""What travels between Medor's services and how: messages, endpoints, codec, bus, errors, launcher."""
