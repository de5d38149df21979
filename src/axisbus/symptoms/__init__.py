"""What a user sees when something is wrong: one page for each symptom, and which errors and codes lead to it."""
