"""Forms of a stage file and their checks: pair, planetary set, general; all end in a Stage (`expand`)."""
