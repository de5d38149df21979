"""The fixes of ``axisbus eds fix``: small functions from a reading to changes of its text, each for one rule."""
