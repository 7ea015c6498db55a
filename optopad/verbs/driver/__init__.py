"""Verbs of the built sensor: its configuration, firmware and readings."""
