"""Makes of drives as drive files: facts from public documents, which each file names; no code."""
