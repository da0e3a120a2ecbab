"""What a solid is made of and what holds it: regions with their materials and places, supports."""
