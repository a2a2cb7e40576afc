"""Tables that stage files have in common: gears, flanks, imports, contact, ports, levels."""
