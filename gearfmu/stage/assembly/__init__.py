"""A stage and its bodies → StageModel, the blob that the kernel runs."""
