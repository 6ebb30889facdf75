"""The distributed optimal coordinator: how far its references stray from the optimum, and for how long (theory.md
6.1)."""
