"""The catalogue: emitters, receivers, elastomers, boards, printers, standard values, each with its source.

Imports of ours: fields.
"""
