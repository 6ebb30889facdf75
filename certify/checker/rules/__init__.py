"""One module per rule of docs/certificate.md. Each returns what the next one builds on, or raises ``Rejected``."""
