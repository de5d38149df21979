"""What people look at: a machine in a notebook, and its page in the browser."""
