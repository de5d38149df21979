"""``axisbus gim6010``: what is particular to the GIM6010-8, in whatever protocol it speaks."""
