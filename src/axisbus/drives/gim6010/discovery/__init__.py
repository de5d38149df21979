"""Finding modules on a bus: by listening, by a limited number of requests, and as a report; without I/O."""
