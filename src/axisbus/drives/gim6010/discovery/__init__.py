"""Finding modules on a bus: what listening tells, what is asked within bounds, and what is told of each; all of it pure."""
