"""Profiles of the property tests: the same examples in every run, and ``--hypothesis-profile=deep`` for a long random search."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "deep",
    max_examples=5000,
    stateful_step_count=80,
    deadline=None,
    derandomize=False,
    suppress_health_check=list(HealthCheck),
)
