"""The room of Yi, Chung, Na, Kim and Suh (2003): the stage of three chains, their equations and
figures.
"""
