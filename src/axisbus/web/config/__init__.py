"""The configuration of nodes on the page: backups, comparisons, and what a restore would write."""
