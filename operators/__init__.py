"""The operators of the extension.

`base` and `modal_job` have base classes and functions of operators. `registration` registers all operators.
"""
