"""CiA 402 as tables and values: words, power-stage states, modes, options, and the interface between motion and a drive."""
