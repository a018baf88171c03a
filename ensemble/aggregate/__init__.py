"""Average over realisations, from results files alone, in bounded memory.

Import from its modules; :func:`adhesis.ensemble.aggregate.average.aggregate` computes all averages.
"""
