"""Image files: reading and writing PNG, writing GIF; numpy only."""
