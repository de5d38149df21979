"""The files of a core for later analysis: its journal, recordings of faults, and the history of simulated motors."""
