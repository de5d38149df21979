"""The ids of the checks, with their texts."""
