"""The units that an agent is written in, and others that suit its loop better: a search that works in units of its own
gives the same verdict for seconds and hours, newtons and kilonewtons (docs/units.md).

Every transformation carries its inverse, and all factors are powers of two: floats and short rationals stay what they
are.
"""
