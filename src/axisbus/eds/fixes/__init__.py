"""What ``axisbus eds fix`` mends: small functions from a reading to changes of its text, each for one rule."""
