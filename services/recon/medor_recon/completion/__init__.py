"""From a view whose pixels know their canonical coordinates to the whole garment, seen and hidden parts alike."""
