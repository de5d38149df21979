"""CiA 402 as tables and values: words, power-stage states, modes, options, and the seam between motion and a drive."""
