"""The questions: one module for each subject, with both models, their bands and the result that it
declares.
"""
