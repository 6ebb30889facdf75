"""Matrix inequalities: solve in floats, round to short rationals, prove exactly (theory.md section 4)."""
