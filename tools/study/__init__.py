"""The study of docs/study/: from results files to the numbers, tables and figures of its page."""
