"""Models as people have them, brought into the normal form of plant files (docs/models.md)."""
