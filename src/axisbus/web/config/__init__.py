"""The configuration of nodes on the page: backups, comparisons, dry runs of a restore, and the restore of settings."""
