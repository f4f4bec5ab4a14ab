"""The operators of the extension.

`base` and `modal_job` have what operators share, and `registration` registers all of them.
"""
