"""Read the input and write the output of ``adhesis loop``: one loop without a campaign."""
