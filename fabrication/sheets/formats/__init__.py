"""Plain formats of the sheets: SVG shapes and symbols, tables, text in Markdown.

Imports nothing of ours.
"""
