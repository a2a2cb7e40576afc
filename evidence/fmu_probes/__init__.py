"""All that can be wrong with an FMU beyond what `gearfmu validate` looks at: names that its libraries export, agreement
of XML and binary, answers to right and wrong calls.

python -m evidence.fmu_probes FILE.fmu
"""
