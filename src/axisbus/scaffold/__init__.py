"""Generate a first cell file for the nodes on a bus; settings that only the user knows are comments to confirm."""
