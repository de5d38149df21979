"""What ``[axes.NAME.feed_forward]`` means for the axis and for its PDOs."""
