"""Plant files that are wrong, and the catalogue of what is said about them: ``python -m tests.wrong``."""
