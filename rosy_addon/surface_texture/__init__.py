"""Surface textures: pictures of a field in a UV map, without visible seams."""
