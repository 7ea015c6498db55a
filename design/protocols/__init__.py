"""Ready press protocols; `optopad simulate --protocol` takes them by name."""
