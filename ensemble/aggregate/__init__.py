"""Average over realisations, from results files alone, in bounded memory; judge them."""
