"""What `import gearfmu` offers: the verbs of the command line as functions. Both call what lies below."""
