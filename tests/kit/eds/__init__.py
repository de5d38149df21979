"""What the tests of EDS files share: texts, samples, planted defects and the cases of the rules."""
