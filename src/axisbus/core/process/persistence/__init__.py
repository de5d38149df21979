"""What a core leaves for whoever comes later: its journal, what the axes did around faults, what simulated motors did."""
