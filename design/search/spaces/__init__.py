"""Ready search spaces; `optopad explore` takes them by name."""
