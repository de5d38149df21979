"""What all tests share: nothing but the folder itself on the path, for ``can_line``."""
