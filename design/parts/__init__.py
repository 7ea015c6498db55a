"""The catalogue: emitters, receivers, elastomers, boards, printers and standard values, each with its source.

The package imports only `optopad.design.fields` and packages below it.
"""
