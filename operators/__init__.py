"""The operators of the extension, one verb in each file.

`modal_job`, `poll`, `preset_shared` and `reports` are helpers that operators share, and
`registration` registers all of them.
"""
