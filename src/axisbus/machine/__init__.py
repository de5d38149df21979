"""The machine: cell.toml to frozen values, everything checked before power, boot-up, wiring."""
