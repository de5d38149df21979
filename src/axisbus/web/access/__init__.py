"""Access control: host, origin, one-time link, role, and limits; decided by functions, enforced by one middleware."""
