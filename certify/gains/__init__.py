"""Conditions on gains that the user gives."""
