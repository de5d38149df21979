"""Shared code of the tests of EDS files: texts, samples, planted defects and the cases of the rules."""
