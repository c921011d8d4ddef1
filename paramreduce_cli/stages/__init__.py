"""The stages of the pipeline, a short file each: glue between records and numerics.

The order of the pipeline is not written down anywhere: it follows from what each stage's
signature reads and returns.
"""
