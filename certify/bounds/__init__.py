"""Rigorous evaluation and bounds: balls, interval ends, suprema over boxes and half-lines."""
