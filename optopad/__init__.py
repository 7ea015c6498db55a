"""The front door: command line, pipeline, report."""
