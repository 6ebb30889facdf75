"""A certified controller as code: discretised exactly, rounded with a bound, printed for C, Python and FMI
(docs/export.md)."""
