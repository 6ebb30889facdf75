"""Certificates changed on purpose: ``python -m tests.tamper`` counts what the checker does with them."""
