"""Who may come in: host, origin, one-time link, role, and limits; decided by functions, kept by one middleware."""
