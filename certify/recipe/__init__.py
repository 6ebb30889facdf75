"""Route "recipe": the paper's constants and thresholds made rigorous (theory.md section 5, docs/certificate.md
sections 3, 4)."""
